"""Tables of many runs."""

import collections

import judge

COLUMNS = [(judge.NAMED, "warned, named"), (judge.UNNAMED, "warned, not named"), (judge.REFUSED, "refused, named"),
           (judge.REFUSED_UNNAMED, "refused, not named"), (judge.NEEDLESS, "needless refusal"), (judge.SILENT, "silent and wrong"),
           (judge.CRASHED, "crashed")]


def line_of(row):
    said = ", ".join(dict.fromkeys(m[0] or "stderr" for m in row["messages"]))
    more = " (in a hint)" if row["hinted"] else ""
    more += " (right where boards were)" if row["outside_only"] else ""
    more += " (its pixels are right)" if row.get("pixels_right") and not row["outside_only"] and row["outcome"] != judge.RIGHT else ""
    more += f" (right with --model {row['right_with']})" if row.get("right_with") else ""
    worst = f" [{row['worst']:.2f} of the limit, {row['worst_px'] or 0:.2f} px]" if row["worst"] is not None else ""
    return f"{row['kind']} {row['seed']}: {row['outcome']}{more}; exit {row['exit']}; {row['why']}{worst}; {said or 'silent'}; {row['seconds']:.1f} s"


def row_text(label, rows, clean=False):
    count = collections.Counter(row["outcome"] for row in rows)
    right = [row for row in rows if row["outcome"] == judge.RIGHT]
    cells = [str(len(rows)), str(len(right)), str(sum(row["warned"] for row in right) or "")]
    cells += [str(count[outcome] or "") for outcome, _ in COLUMNS]
    return f"| {label} | " + " | ".join(cells) + " |"


def by_kind(rows):
    groups = collections.defaultdict(lambda: collections.defaultdict(list))
    for row in rows:
        groups[row["group"]][row["kind"]].append(row)
    lines = ["| recording | runs | right | of them warned | " + " | ".join(title for _, title in COLUMNS) + " |",
             "|---|" + "---|" * (len(COLUMNS) + 3)]
    for group in sorted(groups):
        lines += [row_text(f"{group}: {kind}", groups[group][kind]) for kind in sorted(groups[group])]
    return "\n".join(lines + [row_text("all", rows)])


def clean_figures(rows):
    """Recordings in which nothing is wrong: what is said of them, and what of it the truth contradicts (alarms.py)."""
    clean = [row for row in rows if row["clean"]]
    if not clean:
        return "No clean recording."
    warned, failed = sum(row["warned"] for row in clean), sum(row["failed"] for row in clean)
    codes = collections.Counter(code for row in clean for code in {m[0] for m in row["messages"]})
    false = sum(bool(row.get("false_alarms")) for row in clean)
    list_of = ", ".join(f"{code or 'stderr'} {n}" for code, n in codes.most_common())
    return (f"Of {len(clean)} recordings in which nothing is wrong {sum(row['outcome'] == judge.RIGHT for row in clean)} are right. "
            f"Warned of are {warned}, failed {failed}" + (f" ({list_of})" if list_of else "") +
            f". The truth contradicts what is said of {false}. " + lens_figure(rows))


def lens_figure(rows):
    """How many results are wrong because of the lens that was chosen."""
    wrong = [row for row in rows if row["outcome"] == judge.SILENT]
    by_lens = sum(bool(row.get("right_with")) for row in wrong)
    return f"Of {len(wrong)} silently wrong results {by_lens} are right with the lens model that the recording was made with."


def part_of(row):
    """Stated sigmas count terms that a chosen lens lacks as real cameras have them: they are wider than the errors of made-up lenses
    that lack them exactly."""
    if row["group"] == "held still":
        return "held still"
    return "lenses with decentring" if set(row["true_models"]) <= {"brown4", "brown5"} else "lenses without, some or all"


def coverage(rows):
    """How often the truth lies within one and two of the stated sigmas; 68.3 and 95.4 % for a normal error."""
    totals = collections.defaultdict(lambda: collections.defaultdict(lambda: [0, 0, 0]))
    for row in rows:
        for quantity, counts in (row.get("coverage") or {}).items():
            part = totals[quantity][part_of(row)]
            for k in range(3):
                part[k] += counts[k]
    lines = ["| quantity | | numbers | within 1 sigma | within 2 sigmas |", "|---|---|---|---|---|"]
    for quantity in totals:
        for part, (n, one, two) in sorted(totals[quantity].items()):
            if n:
                lines.append(f"| {quantity} | {part} | {n} | {100 * one / n:.1f} % | {100 * two / n:.1f} % |")
    return "\n".join(lines)


def real_table(runs):
    """Thinned real recordings: a row for each set and number of boards."""
    cells = collections.defaultdict(list)
    for run in runs:
        cells[(run["set"], run["boards"])].append(run)
    lines = ["| set | boards | subsets | refused | warned | fail | held-out median px: default | best fixed lens | default over best |",
             "|---|---|---|---|---|---|---|---|---|"]
    for (name, boards), row in sorted(cells.items()):
        status = collections.Counter(run["default"]["status"] for run in row)
        both = [(run["default"]["median_px"], min(best_of(run))) for run in row if run["default"]["median_px"] and best_of(run)]
        mean = [sum(column) / len(both) for column in zip(*both)] if both else [float("nan")] * 2
        ratio = max((a / b for a, b in both), default=float("nan"))
        lines.append(f"| {name} | {boards} | {len(row)} | {status['refused'] or ''} | {status['warn'] or ''} | {status['fail'] or ''} | "
                     f"{mean[0]:.3f} | {mean[1]:.3f} | {ratio:.2f} at most |")
    return "\n".join(lines)


def best_of(run):
    return [fixed["median_px"] for fixed in run["fixed"].values() if fixed["median_px"]]


def markdown(files):
    rows = [row for file in files for row in file.get("runs", [])]
    thinned = [run for file in files for run in file.get("real", [])]
    parts = [by_kind(rows), clean_figures(rows), coverage(rows)] if rows else []
    return "\n\n".join(parts + ([real_table(thinned)] if thinned else []))
