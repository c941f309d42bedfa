"""What strangers published or reported, as commands and right answers. The inputs are in `reports/` among the recordings.

In arguments `{R}` is the folder of the inputs and `{T}` the case's own empty folder. A check is a pattern that the output
holds, `not PATTERN`, or (what, number of the result, least, most).
"""
from dataclasses import dataclass, field

import read

TRC, PX, DATA, CALIB = "{R}/people/04-trc/", "{R}/people/07-px/", "{R}/data/", "{R}/calib/"
FORMATS = CALIB + "formats/"


@dataclass
class Step:
    args: list
    exit_code: int
    checks: list = field(default_factory=list)


@dataclass
class Case:
    name: str
    steps: list
    packed: list = field(default_factory=list)  # *.gz that are unpacked into {T} first
    slow: bool = False


def trc(name, exit_code, *checks, points="pts.csv", rig="rig.toml"):
    args = ["triangulate", "--calib", TRC + rig, "--points2d", TRC + points, "--truth", TRC + name, "--out", "{T}/o"]
    return Case("markers " + name, [Step(args, exit_code, list(checks))])


def marker_files():
    right = read.metric("{T}/o", "truth.median_mm", 0.3, 1)
    good = [trc(name, 0, right, read.metric("{T}/o", "truth.num", 32, 32))
            for name in ("comma_m.trc", "spaces.trc", "onetab.trc", "blanksep.trc", "clean.trc")]
    real = [trc(name + ".trc", 0, right, "TRI-MARKER-FILE.*header states", points=name + ".pts.csv", rig=name + ".rig.toml")
            for name in ("futureMarkerPreviewData", "std_walking5_markers")]
    return good + real + [trc("blank_label.trc", 0, right, "1 of 4 markers have no name"),
                          trc("markers_walk.trc", 4, "nothing could be compared", r"238 frames, 10 are there")]


def pixels(name, exit_code, cause, *flags):
    """Coordinates of another kind: the cause is named with its flag, and the flag mends it."""
    table = ["triangulate", "--calib", PX + "rig.toml", "--points2d", "{T}/" + name + ".csv", "--out"]
    mended = [read.metric("{T}/mended", "sigma_px", 0.7, 1.6), "not TRI-CAUSE"]
    return Case("coordinates " + name, [Step(table + ["{T}/o"], exit_code, ["TRI-CAUSE", cause, " ".join(flags)]),
                                        Step(table + ["{T}/mended", *flags], 0, mended)], packed=[PX + name + ".csv.gz"])


def poses(folder, calib, skeleton, poses2d):
    return ["triangulate", "--calib", folder + calib, "--skeleton", skeleton,
            *(a for c in ("c0", "c1", "c2", "c3") for a in ("--pose2d", f"{c}={folder}{poses2d}/{c}"))]


def people():
    inverted = poses(DATA + "D-inverted/", "transforms_inverted.json", "body25", "pose2d")
    one = PX + "p_c0.csv"
    ortho = ["triangulate", "--calib", "{R}/people/08-ortho/rig_1e+08.toml", "--unit", "mm", "--points2d", "{T}/pts.csv", "--out", "{T}/o"]
    rates = ["triangulate", "--calib", "{R}/people/17-rates/rig.toml", "--points2d", "{T}/pts.csv", "--out", "{T}/o"]
    nan = poses("{R}/people/14-json-nan/", "rig.toml", "coco17", "p210")
    return [
        pixels("norm", 5, "within 0 to 1", "--normalized"), pixels("yup", 4, "lower edge", "--flip-y"),
        pixels("rot90all", 4, "turned by 90 degrees", "--rotate", "90"),
        pixels("halfrate", 4, "0.5 frames", "--rate", "60", "--rate", "c2=30", "--rate", "c3=30"),
        Case("one recording for two cameras", [Step(["triangulate", "--calib", PX + "rig.toml", "--pose2d", "c0=" + one, "--pose2d",
                                                     "c1=" + one, "--out", "{T}/o"], 3, ["c0 and c1", "one recording was given for both"])]),
        Case("rates of 60 and 150", [Step(rates, 4, ["TRI-CAUSE.*2.50?3? frames", "mvstudio sync"])], packed=["{R}/people/17-rates/pts.csv.gz"]),
        Case("nearly parallel rays", [Step(ortho, 0, ["240 of 240 joints", "CAL-FOCALSIZE"])], packed=["{R}/people/08-ortho/pts.csv.gz"]),
        Case("NaN in JSON", [Step(nan + ["--out", "{T}/o"], 0, ["170 of 170 joints", "TRI-PERSONS-LEFT-OUT"])]),
        Case("an anipose project", [Step(["triangulate", "--project", "{R}/people/18-anipose", "--out", "{T}/o"], 0,
                                         ["960 of 960", "--min-score 0.8", "origin at Fx1", "POSE-PROJECT"])]),
        Case("poses inverted", [Step(inverted + ["--out", "{T}/o"], 5, ["TRI-CAUSE.*poses inverted", "--invert"]),
                                Step(inverted + ["--invert", "--out", "{T}/m"], 0, ["750 of 750 joints"])]),
    ]


def shows(path, exit_code, *checks, more=()):
    return Case("shows " + " ".join([path.split("/")[-1], *more]), [Step(["calib", "show", path, *more], exit_code, list(checks))])


def calibrations():
    other = DATA + "C-other-json/"
    unknown = {"argus.csv": "known are", "cameraIntrinsics.pickle": "Python pickle",
               "campus.json": "VoxelPose"}
    return [shows("{R}/people/09-calib/" + name, 3, words) for name, words in unknown.items()] + [
        shows("{R}/people/09-calib/17012332.xml", 0, "rational8", "817.93", more=("--size", "1280x1024")),
        shows(other + "calibration_full.json", 0), shows(other + "train_meta.json", 0),
        shows(other + "camera-parameters.json", 2, "image size; pass --size"),
        shows(other + "camera-parameters.json", 0, r"50 +0.0000 +4.0898 +5.9987", more=("--size", "1920x1080")),
        shows(other + "camera_extrinsics.json", 3, "MVHumanNet", "not cameras: is missing"),
        shows(other + "camera_intrinsics.json", 3, "lenses without poses"),
        shows(DATA + "A-is_fisheye/transforms.json", 0, "kannala4", "not brown"),
        shows(DATA + "B-same-names", 0, r"(?m)^cam0 ", r"(?m)^cam3 "),
        shows(FORMATS + "avm-fisheye-4x1.yaml", 3, "--lens fisheye or perspective"),
        shows(FORMATS + "avm-fisheye-4x1.yaml", 0, "kannala4", more=("--lens", "fisheye", "--size", "960x640")),
        shows(FORMATS + "colmap-rig", 0, "CAL-MERGED.*2 cameras"),
        shows(FORMATS + "euroc-sensor.yaml", 0),
        shows(FORMATS + "opencv-header-camera_model-fisheye.yaml", 0, "kannala4", "not brown"),
        shows(FORMATS + "opencv-header-equidistant.yaml", 0, "kannala4", "not brown"),
        shows(FORMATS + "ros-ost-fisheye.yaml", 3, "skew -0.966", "--allow-approximation"),
        shows(FORMATS + "ros-ost-fisheye.yaml", 0, "kannala4", more=("--allow-approximation", "2")),
    ]


def images():
    truth = DATA + "F-metrics/truth"
    export = ["dataset", "export", DATA + "E-masks/", "--to", "colmap", "--masks", "alpha", "--out", "{T}/o"]
    masks = [Case("masks " + kind, [Step([a + kind if a.endswith("E-masks/") else a for a in export], 0, [read.opaque("{T}/o", 0.0463, 0.0464)])])
             for kind in ("01", "255", "labels", "alpha")]
    return masks + [
        Case("straight alpha", [Step(["metrics", truth, DATA + "F-metrics/render_alpha"], 0, ["SSIM 1.0000", "opacity"])]),
        Case("names that differ", [Step(["metrics", truth, DATA + "F-metrics/other_names", "--distance-only"], 0, ["FD "])]),
        Case("stored statistics", [Step(["metrics", DATA + "H-fid/stats.npz", DATA + "H-fid/stats.npz"], 0, ["FD"])]),
        Case("a .tar not unpacked", [Step(["dataset", "import", "panoptic", DATA + "G-panoptic/tarred", "--out", "{T}/o"], 3, ["tar -xf"])]),
    ]


def corners(name, checks, *, packed=False, slow=False, more=(), own=()):
    """Calibrates, and judges the result on the very corners that it was made from: nothing has moved."""
    path = ("{T}/" if packed else CALIB) + name + ".csv"
    steps = [Step(["calibrate", "--corners", path, "--out", "{T}/run", *more], 0, checks),
             Step(["calib", "eval", "{T}/run/calibration.json", "--corners", path], 0, ["not MOVED", "not LENSCHANGED", *own])]
    return Case(" ".join(["corners", name, *more]), steps, packed=[CALIB + name + ".csv.gz"] if packed else [], slow=slow)


def boards():
    board = lambda text, folder, f: Step(["calibrate", "--board", text, "--camera", "a=" + CALIB + folder, "--out", "{T}/run"], 0,
                                         [read.focal("{T}/run", "a", 0.999 * f, 1.001 * f)])
    near = lambda a, b, mm, tolerance: read.distance("{T}/run", a, b, mm - tolerance, mm + tolerance)
    square = board("chessboard:9x9:25mm", "square-9x9", 900 * 482 / 810)  # f = 900 before the images were made smaller
    white = board("chessboard:8x6:30mm", "white-corner-8x6", 900 * 643 / 960)
    square.checks.append(read.metric("{T}/run", "num_frames", 9, 9))
    white.checks.append("inverted")
    return [
        Case("square board", [square]), Case("white corner squares", [white]),
        corners("22_two", ["CAL-NUMBERING", "not MOVED", near("a", "b", 300, 0.3)]),
        corners("40_offset", ["not LENSCHANGED"], packed=True, slow=True, own=["verdict: pass"]),
        corners("39_clock", ["CAL-CLOCK", near("a", "b", 400, 1)], packed=True, slow=True),
        corners("16_rect", ["CAL-LENGTHS.*not squares", "22.5x24.5mm"]),
        corners("15_moved", ["CAL-BOARDS", read.metric("{T}/run", "cameras.#", 4, 4)], packed=True, slow=True),
        corners("24_dlt", [read.focal("{T}/run", "C1", 1150, 1250)]),
        corners("photon-charuco-1280", ["verdict: pass", "not thinprism"]),
    ]


ALL = marker_files() + people() + calibrations() + images() + boards()
