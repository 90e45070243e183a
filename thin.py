import sys; sys.path.insert(0,"/tmp/wt/files")
import numpy as np
from dataclasses import replace
from weldsim.cloud.files import read_cloud
from weldsim.cloud.filters import voxel_grid
from weldsim.pipeline import plan
from weldsim.cloud.extent import _spacing
for s in ("curve","straight"):
  c=read_cloud(f"/tmp/scratch-files/{s}.npz")
  for v in (0.0015,0.002,0.0025,0.003,0.0035,0.004,0.005,0.006):
    d=voxel_grid(c,v)
    rng=np.random.default_rng(0); e=c.select(rng.random(len(c))<len(d)/len(c))
    for name,q in (("voxel",d),("random",e)):
      for vp in (1,0):
        q2=q if vp else replace(q,viewpoints=np.zeros((0,3)),view=None)
        r=plan(q2); print(s,v,name,vp,len(q),round(_spacing(q.points)*1e3,2),[(round(x.length,3),round(x.width,4),round(x.confidence,2)) for x in r.findings.seams],[(round(q.length,3),q.reason[:50]) for q in r.findings.rejected[:1]])
