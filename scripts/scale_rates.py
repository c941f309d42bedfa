"""Measured sessions, and the rates of stages that follow from them. Seconds are of user and system on one thread.

How they were measured, and on which machine: docs/scale.md. SMALL and WIDE give the rates; LARGE tests what they predict."""
from scale_model import HD, VGA, Rate

START = 1.67  # s: `mvstudio run SESSION --dry-run`, which is in every stage

# Stage -> seconds, peak memory in bytes, bytes written.
SMALL = {"cameras": 4, "images": 96, "mpx": VGA, "stages": {
    "sync": (1.90, 204.4e6, 5968), "triangulate": (2.20, 222.6e6, 235604), "mask": (35.16, 536.8e6, 5134912),
    "dataset": (5.35, 240.3e6, 5957532), "verify": (6.62, 206.9e6, 2060), "pack": (4.60, 237.2e6, 7248845),
    "export": (2.01, 211.2e6, 248799), "split": (1.69, 194.6e6, 1446)}}
WIDE = {"cameras": 4, "images": 96, "mpx": HD, "stages": {
    "calibrate": (96.39, 473.1e6, 359122), "sync": (2.54, 207.4e6, 5709), "triangulate": (4.10, 273.6e6, 253715),
    "mask": (157.33, 1323.0e6, 5521031), "dataset": (27.77, 407.0e6, 26260506), "verify": (28.78, 212.0e6, 2071),
    "pack": (9.42, 238.8e6, 7060258), "export": (5.97, 240.8e6, 1079506), "split": (1.72, 194.9e6, 1452),
    "avatar": (44.42, 419.2e6, 52098650), "eval": (10.37, 346.5e6, 121516), "report": (2.30, 223.8e6, 7370932)}}
LARGE = {"cameras": 6, "images": 168, "mpx": VGA, "stages": {
    "sync": (1.85, 206.1e6, 7547), "triangulate": (2.37, 221.4e6, 299036), "mask": (82.62, 541.4e6, 7921172),
    "dataset": (7.92, 241.6e6, 10660874), "pack": (4.82, 277.2e6, 13387549)}}

MASK_SETUP = 12.3  # s for each camera and megapixel: the 102 s of WIDE before its first mask

POSE = 0.41            # s an image: movenet, balanced, 8 VGA images, with the search for the person
TRIANGULATE = 0.17e-3  # s an image of long takes, and
POINT_BYTES = 1.1e3    # bytes an image: docs/notes/growth.md, 1,000 to 4,000 frames of 4 cameras
JSON_BYTES = 1450      # of an image's 2D joints

# Stage -> stages that it waits for, whether it is of a take: `mvstudio plan SESSION --to split`, and the report.
STAGES = {
    "calibrate": ((), False, None),
    "pose2d": ((), True, None),
    "sync": (("calibrate", "pose2d"), True, None),
    "triangulate": (("calibrate", "pose2d", "sync"), True, None),
    "mask": (("calibrate", "triangulate"), True, None),
    "dataset": (("calibrate", "triangulate", "mask"), True, None),
    "verify": (("dataset",), True, None),
    "pack": (("dataset",), True, None),
    "split": (("dataset",), True, None),
    "report": (("calibrate", "pose2d", "sync", "triangulate", "mask", "dataset", "verify", "pack", "split"), False, None),
}


def slopes(stage, what, setup=0.0):
    """(constant, of a megapixel) of an image's cost, from SMALL and WIDE; never below 0."""
    shares = []
    for session in (SMALL, WIDE):
        value = session["stages"][stage][what] - (START if what == 0 else 0.0) - session["cameras"] * session["mpx"] * setup
        shares.append(max(0.0, value) / session["images"])
    slope = max(0.0, (shares[1] - shares[0]) / (HD - VGA))
    return max(0.0, shares[0] - slope * VGA), slope


def rate(stage, setup=0.0, **more):
    """The rate of a stage whose seconds and bytes grow with images and pixels."""
    constant, slope = slopes(stage, 0, setup)
    low, high = SMALL["stages"][stage][1], WIDE["stages"][stage][1]
    per_mpx = max(0.0, (high - low) / (HD - VGA))
    memory = (max(0.0, low - per_mpx * VGA), per_mpx, 0.0)
    return Rate(fixed=START, camera_mpx=setup, image=constant, image_mpx=slope,
                **dict({"write": slopes(stage, 2), "memory": memory}, **more))


def predicted(stage):
    """From SMALL and WIDE alone, as a user would."""
    return rate(stage, MASK_SETUP if stage == "mask" else 0.0)


IMAGE = slopes("dataset", 2)  # of an image with its mask, in a dataset
MASK = (2.2e3, 2.9e3)         # of its mask alone; the stage's other files are sheets, one for each camera
RATES = {
    "calibrate": Rate(fixed=START, image_mpx=(WIDE["stages"]["calibrate"][0] - START) / WIDE["images"] / HD, footage=2),
    "pose2d": Rate(fixed=START, image=POSE, footage=2, write=(JSON_BYTES, 0), files=1, opens=1, memory=(316e6, 0, 0),
                   spread="cameras"),
    "sync": Rate(fixed=START, image=TRIANGULATE, read=(2 * JSON_BYTES, 0), opens=2, memory=(200e6, 0, 0)),
    "triangulate": Rate(fixed=START, image=TRIANGULATE, read=(2 * JSON_BYTES, 0), opens=2, write=slopes("triangulate", 2),
                        memory=(95e6, 0, POINT_BYTES)),
    "mask": rate("mask", MASK_SETUP, write=MASK, footage=3, files=1, opens=1, spread="cameras"),
    "dataset": rate("dataset", footage=2, read=MASK, files=2, opens=4, spread="images"),
    "verify": rate("verify", read=IMAGE, opens=4, write=(0, 0), spread="cameras"),
    "pack": rate("pack", read=IMAGE, opens=4, spread="images"),
    "split": Rate(fixed=START, opens=2),
    "report": Rate(fixed=WIDE["stages"]["report"][0]),
}
