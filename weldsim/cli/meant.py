"""What people say for a command, an option or a choice."""

from weldsim.settings import MEANT_VALUES

MEANT_COMMANDS = {
    **dict.fromkeys(("weld", "simulate", "sim", "twin", "demo", "start"), "run"),
    **dict.fromkeys(("check", "verify", "validate", "dryrun", "dry", "reach"), "dry-run"),
    **dict.fromkeys(("show", "draw", "view", "display", "picture"), "scenes show"),
    **dict.fromkeys(("export", "mjcf"), "scenes export"),
    **dict.fromkeys(("list", "ls", "parts", "workpieces"), "scenes"),
    **dict.fromkeys(("settings", "set", "configure", "options"), "config"),
    **dict.fromkeys(("find", "detect", "seam", "path"), "plan"),
    **dict.fromkeys(("capture", "see", "look", "camera"), "scan"),
    **dict.fromkeys(("robot", "send", "play"), "execute"),
    **dict.fromkeys(("test", "compare", "bench", "benchmark", "regression"), "regress"),
    **dict.fromkeys(("serve", "server", "ursim"), "controller"),
    **dict.fromkeys(("fault",), "controller fault"),
    **dict.fromkeys(("diagnose", "install", "info"), "doctor"),
    **dict.fromkeys(("version", "v"), "--version"),
}
"""What people say for a command."""

MEANT_OPTIONS = {
    **dict.fromkeys(("output", "outfile", "output-dir", "out-dir", "folder", "dir", "o", "save"), ("out",)),
    **dict.fromkeys(("camera",), ("sensor",)),
    **dict.fromkeys(("finder", "algorithm"), ("method", "methods")),
    **dict.fromkeys(("film", "movie", "mp4"), ("video",)),
    **dict.fromkeys(("page",), ("report", "html")),
    **dict.fromkeys(("unit",), ("units",)),
    **dict.fromkeys(("settings", "setting", "param", "s"), ("set",)),
    **dict.fromkeys(("file", "c", "cfg", "settings-file"), ("config",)),
    **dict.fromkeys(("ip", "address", "robot-ip"), ("host",)),
    **dict.fromkeys(("scale", "slow"), ("speed-scale",)),
    **dict.fromkeys(("n", "count", "repeat"), ("seeds",)),
    **dict.fromkeys(("j", "workers", "processes", "threads"), ("jobs",)),
}
"""What people say for an option."""

MEANT_CHOICES = {
    "robot": {
        **dict.fromkeys(("simulated", "simulation", "simulator", "simulate", "twin", "mujoco", "virtual"), "sim"),
        **dict.fromkeys(("real", "ur5", "ur5e", "ur_rtde", "rtde", "urx", "ursim", "cb3"), "ur"),
    },
    "sensor": {
        **dict.fromkeys(("realsense", "depth"), "d415"),
        **dict.fromkeys(("kinectv2", "kinect2", "kinect-v2"), "kinect"),
        **dict.fromkeys(("ideal", "perfect", "true", "none"), "exact"),
        **dict.fromkeys(("stereo", "d415_stereo"), "d415-stereo"),
    },
    "method": MEANT_VALUES["method"],
    "tool": {**dict.fromkeys(("tip", "wire", "tcp"), "torch"), **dict.fromkeys(("flange", "tool", "bare"), "tool0")},
    "base": {**dict.fromkeys(("base", "ur"), "controller"), **dict.fromkeys(("ros", "urdf", "baselink"), "base_link")},
    "profile": {**dict.fromkeys(("e-series", "eseries", "ur5e"), "e"), **dict.fromkeys(("ur5", "cb"), "cb3")},
}
"""What people say for a choice of an option."""

SUFFIXES = {
    "run": (".toml",),
    "plan": (".ply", ".pcd", ".xyz", ".npz", ".npy"),
    "dry-run": (".json", ".csv", ".script", ".urscript"),
}
"""What the files of a command end in."""
