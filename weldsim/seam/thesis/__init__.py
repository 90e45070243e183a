"""The thesis's seam finder (chapter 5), the baseline that every report compares with.

One noun a file, in the order of the chapter: voxel, mls, normals, descriptor, threshold, clusters, boundary, midpoints,
thin, order, axes; `find` runs them. `kernels` holds the neighbourhood loops in numba and is imported when first used.
"""
