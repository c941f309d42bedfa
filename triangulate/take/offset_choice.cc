#include "triangulate/take/offset_choice.h"

#include <algorithm>
#include <cmath>

#include "core/choice/heldout_choice.h"
#include "core/format.h"
#include "core/parallel.h"
#include "triangulate/sync/sync.h"
#include "triangulate/take/steps.h"

namespace mvstudio::triangulate {
namespace {

constexpr size_t kMaxFrames = 240;
constexpr double kSigmas = 2;
constexpr int kMinSamples = 50;  // as MethodChoiceOptions::min_samples

std::vector<double> Times(double factor, const std::vector<double>& offsets) {
  std::vector<double> scaled;
  for (const double offset : offsets) scaled.push_back(std::isfinite(offset) ? factor * offset : 0);
  return scaled;
}

/// The frames whose numbers are among `numbers`, which ascend.
std::vector<DetectedFrame> Pick(const std::vector<DetectedFrame>& frames, const std::vector<int>& numbers) {
  std::vector<DetectedFrame> picked;
  for (const DetectedFrame& frame : frames) {
    if (std::binary_search(numbers.begin(), numbers.end(), frame.frame)) picked.push_back(frame);
  }
  return picked;
}

std::vector<int> SpreadNumbers(const std::vector<DetectedFrame>& frames) {
  std::vector<int> numbers;
  const size_t count = std::min(kMaxFrames, frames.size());
  for (size_t i = 0; i < count; ++i) numbers.push_back(frames[i * frames.size() / count].frame);
  return numbers;
}

LeftOutFigures LeaveOut(const geometry::Rig& rig, const std::vector<DetectedFrame>& frames, const TakeBody& body,
                        TakeOptions options, const RunContext& run) {
  options.method = ByPoint(PointMethod::kLinear), options.select_views = true;
  const TakeProblem problem = PrepareTake(rig, frames, body, options, run);
  return HoldOut(problem, SolverFor(rig, problem, options, options.method), std::max(options.holdout_points, 500),
                 ResolveThreads(run.num_threads))
      .all;
}

/// How far `b` is worse than `a`, in standard errors: the offsets change which frames and detections take part, so the two do
/// not come in pairs.
double Worse(const LeftOutFigures& a, const LeftOutFigures& b) {
  UnitMean difference =
      DifferenceOfMeans({b.median_px, b.median_error_px, b.num_samples}, {a.median_px, a.median_error_px, a.num_samples});
  difference.standard_error = std::max(difference.standard_error, 1e-12);
  return InStandardErrors(difference);
}

}  // namespace

OffsetTrial TryOffsets(const geometry::Rig& rig, const std::vector<DetectedFrame>& frames,
                       const std::vector<double>& offset_frames, const TakeBody& body, const TakeOptions& options,
                       const RunContext& run) {
  const std::vector<int> numbers = SpreadNumbers(frames);
  const auto figures = [&](double factor) {
    return LeaveOut(rig, Pick(ApplyOffsets(frames, Times(factor, offset_frames)), numbers), body, options, run);
  };
  const LeftOutFigures without = figures(0), with = figures(1), reversed = figures(-1);
  OffsetTrial trial{false, "", without.median_px, with.median_px, reversed.median_px};
  const bool enough = std::min({without.num_samples, with.num_samples, reversed.num_samples}) >= kMinSamples;
  trial.confirmed = enough && Worse(with, without) > kSigmas && Worse(with, reversed) > kSigmas;
  const std::string text = Format("left-out cameras err by %.2f px with them, %.2f px without, %.2f px with them reversed",
                                  with.median_px, without.median_px, reversed.median_px);
  trial.reason = enough ? text : "too few joints are seen by three cameras to decide";
  return trial;
}

}  // namespace mvstudio::triangulate
