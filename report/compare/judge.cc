#include <algorithm>
#include <cmath>
#include <limits>

#include "report/compare/compared.h"
#include "report/page/format.h"

namespace mvstudio::report {
namespace {

constexpr size_t kMostEntries = 1000;  // cameras that a page can show
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

std::string EntryName(const Value& entry) { return entry["name"].Text(entry["camera"].Text()); }

const Value& EntryNamed(const Value& list, const std::string& name) {
  static const Value null;
  for (size_t i = 0; i < std::min(list.items().size(), kMostEntries); ++i) {
    if (EntryName(list.At(i)) == name) return list.At(i);
  }
  return null;
}

/// What a figure of `entry` is read from; null where the run does not have it.
const Value& PlaceIn(const Stage* stage, const Figure& figure, const std::string& entry) {
  static const Value null;
  if (!stage) return null;
  return *figure.list ? EntryNamed(stage->metrics().Path(figure.list), entry) : stage->metrics();
}

/// Numbers that agree in three digits are told as equal where no spread is known.
bool AgreeInThreeDigits(double a, double b) { return std::abs(a - b) < 5e-4 * std::max(std::abs(a), std::abs(b)); }

Change Judge(const ComparedFigure& compared) {
  const double first = compared.values.front(), last = compared.values.back(), difference = last - first;
  if (!std::isfinite(difference)) return Change::kOnlyOne;
  if (compared.figure->of_held_out && !compared.stage->why_not.empty()) return Change::kNotCompared;
  if (std::abs(difference) <= 1e-12 * std::abs(first)) return Change::kEqual;  // sums in another order
  if (std::abs(difference) <= compared.half_width) return Change::kWithin;
  if (!std::isfinite(compared.half_width) && AgreeInThreeDigits(first, last)) return Change::kEqual;
  if (compared.figure->better == Better::kNeither) return Change::kDiffers;
  return (difference > 0) == (compared.figure->better == Better::kMore) ? Change::kBetter : Change::kWorse;
}

ComparedFigure CompareOne(const ComparedStage& stage, const Figure& figure, const std::string& entry) {
  ComparedFigure compared{&figure, &stage, entry, {}, {}, kNan, Change::kEqual};
  for (const Stage* run : stage.runs) {
    const Value& place = PlaceIn(run, figure, entry);
    compared.values.push_back(place.IsNull() ? kNan : FigureNumber(figure, place));
    compared.half_widths.push_back(FigureHalfWidth(figure, place));
  }
  compared.half_width = std::hypot(compared.half_widths.front(), compared.half_widths.back());
  compared.change = Judge(compared);
  return compared;
}

/// Names of the entries of a figure's list in any run; one empty name for a figure of the whole.
std::vector<std::string> EntriesOf(const ComparedStage& stage, const Figure& figure) {
  if (!*figure.list) return {""};
  std::vector<std::string> names;
  for (const Stage* run : stage.runs) {
    if (!run) continue;
    const Value& list = run->metrics().Path(figure.list);
    for (size_t i = 0; i < std::min(list.items().size(), kMostEntries); ++i) {
      const std::string name = EntryName(list.At(i));
      if (!name.empty() && std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
    }
  }
  return names;
}

bool IsAnywhere(const ComparedFigure& compared) {
  return std::any_of(compared.values.begin(), compared.values.end(), [](double v) { return std::isfinite(v); });
}

}  // namespace

std::string_view ToString(Change change) {
  static constexpr std::string_view kWords[] = {"worse", "better",       "differs",     "within the spread",
                                                "equal", "not compared", "one run only"};
  return kWords[static_cast<int>(change)];
}

std::string ComparedFigure::Name() const { return entry.empty() ? figure->label : entry + ": " + figure->label; }

std::vector<ComparedFigure> CompareFigures(const std::vector<ComparedStage>& stages) {
  std::vector<ComparedFigure> figures;
  for (const ComparedStage& stage : stages) {
    for (const Figure& figure : Figures()) {
      if (stage.command != figure.command || figure.of_machine) continue;
      for (const std::string& entry : EntriesOf(stage, figure)) {
        ComparedFigure compared = CompareOne(stage, figure, entry);
        if (IsAnywhere(compared)) figures.push_back(std::move(compared));
      }
    }
  }
  return figures;
}

std::string FigureText(const Figure& figure, double value) {
  return std::string(figure.unit).empty() && value == std::floor(value) && std::abs(value) >= 1000
             ? FormatCount(value)
             : FormatWithUnit(value, figure.unit);
}

std::string SignedText(double value) { return (value > 0 ? "+" : "") + FormatNumber(value, 3); }

}  // namespace mvstudio::report
