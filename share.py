import sys,time; sys.path.insert(0,"/tmp/wt/files"); sys.path.insert(0,"/tmp/scratch-files")
import numpy as np, glob
import weldsim.cloud.visible as v
from weldsim.cloud.files import read_cloud
def share(place,depth):
    keep=np.isfinite(depth); place,depth=place[keep],depth[keep]
    k=max(1,len(depth)//v.SAMPLE); place,depth=place[::k],depth[::k]
    cell,size=v._cells(place); order=np.lexsort((depth,cell)); same=np.diff(cell[order])==0
    step=np.where(same,np.diff(depth[order]),0); number=np.bincount(cell); full=number>=v.FEWEST
    two=np.zeros(len(number),bool); two[cell[order][1:][step>max(v.GAP,size)]]=True
    return round(float((two&full).sum()/max(1,full.sum())),3), int(full.sum()), round(size*1e3,2)
for f in sorted(glob.glob("/tmp/scratch-files/*.npz"))+sorted(glob.glob("/work/shared/data/real/wavy_table/*.pcd"))+glob.glob("/work/shared/data/real/tee_tubes/*.pcd")+glob.glob("/work/shared/data/real/fin*/*.pcd")+["/work/shared/data/real/curved_groove_scan.ply","/work/shared/data/real/butt_gap/butt_gap.ply"]:
    c=read_cloud(f)
    print(f.split("/")[-1], "none",share(*v._along(c.points,v._thinnest(c))), [ (vp,share(*v._seen_from(c.points,np.array(vp,float)))) for vp in ((0,-.75,.75),(0,-.45,.42),(0,0,.6),(0,0,0))], c.viewpoints[:1])
from whole import cloud
for t in (12,20,40,60):
    c=cloud(t); print(t, share(*v._along(c.points,v._thinnest(c))), share(*v._seen_from(c.points,np.array([0,-.45,.42]))), share(*v._seen_from(c.points,np.array([.3,-.2,.42]))))
