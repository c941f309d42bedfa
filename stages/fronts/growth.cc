#include "stages/fronts/growth.h"

#include <iterator>

#include "core/disk/output.h"
#include "core/format.h"
#include "stages/fronts/measure_growth.h"

namespace mvstudio::stages {
namespace {

constexpr double kLeastSeconds = 0.15, kMostExponent = 1.25;
constexpr const char* kAxes[] = {"cameras", "frames", "pixels"};

struct KnownGrowth {
  const char *stage, *axis, *reason;
};

/// What grows faster for a reason. Nothing does in frames.
constexpr KnownGrowth kKnownGrowth[] = {
    {"calibrate", "cameras", "all cameras are unknowns of one dense system, whose factor costs the cube of their number"},
    {"triangulate", "cameras", "each camera is left out in turn to judge the joints, which are then solved from all others"},
};

struct GrowthPlan {
  StudioSize base;
  std::vector<int> factors;
};

GrowthPlan PlanOfGrowth(bool quick) {
  if (quick) return {{3, 240, 180, 24, 8}, {1, 2, 4}};
  return {{4, 320, 240, 24, 12}, {1, 4, 16}};
}

/// `factor` times the cameras, frames or pixels.
StudioSize Grown(StudioSize size, const std::string& axis, int factor) {
  if (axis == "cameras") size.cameras *= factor;
  if (axis == "frames") size.board_frames *= factor, size.take_frames *= factor;
  if (axis == "pixels") {
    const double side = std::sqrt(static_cast<double>(factor));
    size.width = 2 * static_cast<int>(std::lround(size.width * side / 2));
    size.height = 2 * static_cast<int>(std::lround(size.height * side / 2));
  }
  return size;
}

GrowthRow* RowOf(const std::string& stage, const std::string& axis, std::vector<GrowthRow>* rows) {
  for (GrowthRow& row : *rows)
    if (row.stage == stage && row.axis == axis) return &row;
  rows->push_back({});
  rows->back().stage = stage, rows->back().axis = axis;
  return &rows->back();
}

/// Whether the next size would take more than two minutes, by what the last one took.
bool TooLong(const GrowthRow& row, double factor) {
  constexpr double kMostSeconds = 120;
  return !row.cpu_s.empty() && row.cpu_s.back() * factor / row.factors.back() > kMostSeconds;
}

class GrowthRun {
 public:
  GrowthRun(const FrontsMeter& meter, const std::vector<std::string>& only, bool quick, ProgressStage* stage)
      : meter_(meter), only_(only), quick_(quick), stage_(stage), plan_(PlanOfGrowth(quick)) {}

  std::vector<GrowthRow> Measure() {
    for (const char* axis : kAxes) {
      for (const int factor : plan_.factors) MeasureSize(axis, factor);
    }
    for (GrowthRow& row : rows_) FinishGrowth(&row);
    return std::move(rows_);
  }

 private:
  /// The smallest studio is that of all axes.
  void MeasureSize(const std::string& axis, int factor) {
    stage_->Advance(0, Format("growth, %d times the %s", factor, axis.c_str()));
    if (factor > 1) {
      MeasureStages(axis, factor, {axis});
    } else if (axis == kAxes[0]) {
      MeasureStages(axis, factor, {std::begin(kAxes), std::end(kAxes)});
    }
    stage_->Advance(1);
  }

  /// What each stage does without flags; its figures are of all `axes`.
  void MeasureStages(const std::string& axis, int factor, const std::vector<std::string>& axes) {
    const LentFolder lent(meter_.runs() + Format("/grown-%s-%d", axis.c_str(), factor));
    const std::string session = lent.path() + "/session";
    meter_.MakeStudio(Grown(plan_.base, axis, factor), {{"samples", {"1"}}, {"board", {"charuco:5x4:240mm:180mm"}}}, session);
    FrontsMaterial material = meter_.MaterialOf(session, "", quick_);
    material.whole_take = true, material.runs = lent.path() + "/runs";
    for (const PlannedFront& front : PlanFronts(material, only_)) {
      const std::string& stage = front.front.stage;
      if (stage == "pack") continue;  // a crop costs what it costs
      GrowthRow* row = RowOf(stage, axis, &rows_);
      if (!row->why_not.empty()) continue;
      if (TooLong(*row, factor)) {
        row->why_not = Format("%d times as many would take more than two minutes", factor);
        continue;
      }
      if (!front.front.why_not.empty()) continue;
      const FrontWay way = meter_.MeasureWay(front.ways.front());
      for (const std::string& each : axes) Take(stage, each, factor, way);
    }
  }

  void Take(const std::string& stage, const std::string& axis, int factor, const FrontWay& way) {
    GrowthRow* row = RowOf(stage, axis, &rows_);
    if (!std::isfinite(way.time())) {
      row->why_not = way.why_not;
      return;
    }
    row->factors.push_back(factor), row->cpu_s.push_back(way.time());
    row->peak_rss_mb.push_back(way.peak_rss_mb), row->error.push_back(way.error);
  }

  const FrontsMeter& meter_;
  const std::vector<std::string>& only_;
  const bool quick_;
  ProgressStage* stage_;
  const GrowthPlan plan_;
  std::vector<GrowthRow> rows_;
};

}  // namespace

bool GrowthRow::WorseThanLinear() const { return exponent > kMostExponent; }

double GrowthExponent(const std::vector<double>& factors, const std::vector<double>& seconds) {
  const size_t n = seconds.size();
  if (n < 2 || factors.size() != n || !(seconds[n - 1] - seconds[0] >= kLeastSeconds)) return NAN;
  const double step = std::log(factors[n - 1] / factors[n - 2]);
  if (n == 2) return std::log(seconds[1] / seconds[0]) / step;
  const double first = seconds[n - 2] - seconds[n - 3], second = seconds[n - 1] - seconds[n - 2];
  return first > 0 && second > 0 ? std::log(second / first) / step : NAN;
}

void FinishGrowth(GrowthRow* row) {
  row->exponent = GrowthExponent(row->factors, row->cpu_s);
  if (!row->WorseThanLinear()) return;
  row->reason = "no reason is known";
  for (const KnownGrowth& known : kKnownGrowth)
    if (row->stage == known.stage && row->axis == known.axis) row->reason = known.reason;
}

int NumGrownStudios(bool quick) { return static_cast<int>(std::size(kAxes) * PlanOfGrowth(quick).factors.size()); }

std::string GrownStudio(bool quick) {
  const GrowthPlan plan = PlanOfGrowth(quick);
  return Format("%d cameras of %dx%d px, %d frames of a board, %d of a person", plan.base.cameras, plan.base.width,
                plan.base.height, plan.base.board_frames, plan.base.take_frames);
}

std::vector<GrowthRow> MeasureGrowth(const FrontsMeter& meter, const std::vector<std::string>& only, bool quick,
                                     ProgressStage* stage) {
  return GrowthRun(meter, only, quick, stage).Measure();
}

}  // namespace mvstudio::stages
