"""What became of a recording: one of OUTCOMES."""

import dataclasses

import truth

RIGHT, NAMED, UNNAMED = "right", "warned, cause named", "warned, cause not named"
REFUSED, REFUSED_UNNAMED = "refused, cause named", "refused, cause not named"
NEEDLESS, SILENT = "needless refusal", "silent and wrong"
CRASHED = "crashed or hung"
OUTCOMES = [RIGHT, NAMED, UNNAMED, REFUSED, REFUSED_UNNAMED, NEEDLESS, SILENT, CRASHED]
BAD = {NEEDLESS, SILENT, CRASHED}
LEVELS = (1.0, 2.0)


@dataclasses.dataclass
class Judgement:
    outcome: str
    warned: bool = False         # it said something, or its verdict is not `pass`
    failed: bool = False         # exit 4
    why: str = ""                # the quantity that is farthest off, or the lens that would have done
    worst: float = float("nan")  # that quantity over its limit
    worst_px: float = float("nan")
    hinted: bool = False         # the cause stands in a hint only
    outside_only: bool = False   # right wherever a board was seen
    comparison: object = None


def is_refusal(run):
    return run.exit not in (0, 4)


def has_crashed(run):
    return run.exit in ("timeout", 1) or (isinstance(run.exit, int) and (run.exit < 0 or run.exit > 128))


def names(kind, recording, messages, with_hints=False):
    texts = [f"{code} {text}" + (f" {hint}" if with_hints else "") for code, text, hint in messages]
    return any(kind.names_cause(text, recording.culprits) for text in texts)


def compare(recording, run):
    """Comparison with the truth, None where there is nothing to compare."""
    if run.calibration is None or not run.result.get("metrics", {}).get("cameras"):
        return None
    return truth.best_comparison(recording, run.calibration, run.result["metrics"])


def judge(kind, recording, run, with_model):
    """`with_model(model)` runs the program on the same recording with that --model; asked after a refusal only."""
    messages = run.messages()
    named = names(kind, recording, messages)
    hinted = not named and names(kind, recording, messages, True)
    if has_crashed(run):
        return Judgement(CRASHED, why=f"exit {run.exit}")
    if is_refusal(run):
        return judge_refusal(kind, recording, named, hinted, with_model)
    comparison = compare(recording, run)
    if comparison is None:
        return Judgement(CRASHED, why=f"exit {run.exit} without a calibration")
    verdict = run.result["metrics"].get("verdict", {}).get("status")
    warned = bool(messages) or verdict != "pass"
    said = NAMED if named else UNNAMED
    outcome = RIGHT if comparison.right else said if warned else SILENT
    return Judgement(outcome, warned, run.exit == 4, comparison.why, comparison.worst, comparison.worst_pixel(), hinted,
                     comparison.inside_only, comparison)


def judge_refusal(kind, recording, named, hinted, with_model):
    for model in kind.simpler:
        other = with_model(model)
        comparison = None if is_refusal(other) else compare(recording, other)
        if comparison and comparison.right:
            return Judgement(NEEDLESS, True, True, f"--model {model} is right", hinted=hinted)
    return Judgement(REFUSED if named else REFUSED_UNNAMED, True, True, hinted=hinted)


def right_with_true_lens(recording, done, with_model):
    """Of a result that is not right: the recording's own lens model when the program is right with that --model, else None. The
    choice of the lens is then the reason."""
    model = max((c.lens.model for c in recording.scene.cameras), key=len)
    if done.outcome == RIGHT or "--start" in recording.arguments:
        return None
    comparison = compare(recording, with_model(model))
    return model if comparison and comparison.right else None


# ---- coverage of the stated sigmas ----------------------------------------------------------------------------------------------

def coverage(comparison):
    """{quantity: [how many, within one sigma, within two]}. Of a pixel each coordinate counts, over the sigma of the pixel's worst
    direction: it may lie within it more often than a normal number does."""
    counts = {}
    for q in comparison.quantities:
        count(counts, q.kind, [q.z()])
    for errors, sigmas, seen in comparison.pixels.values():
        count(counts, "pixel", (abs(errors) / sigmas[:, None])[seen].ravel())
        count(counts, "pixel where no board was", (abs(errors) / sigmas[:, None])[~seen].ravel())
    return counts


def count(counts, kind, values):
    row = counts.setdefault(kind, [0, 0, 0])
    row[0] += int(len(values))
    for k, level in enumerate(LEVELS):
        row[1 + k] += int(sum(v <= level for v in values))
