#include "avatar/body/fit/fit_judge.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "core/parallel.h"
#include "core/statistics.h"

namespace mvstudio::body {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// `loss(step, vertices)` of each held-out time step whose trunk the joints determine.
template <class Loss>
std::vector<double> HeldOutLosses(const PersonBody& person, const std::vector<FitStep>& steps, const RunContext& run,
                                  const Loss& loss) {
  std::vector<double> losses(steps.size(), kNan);
  ParallelFor(static_cast<int64_t>(steps.size()), run.num_threads, [&](int64_t i) {
    const FitStep& step = steps[i];
    if (std::none_of(step.views.begin(), step.views.end(), [](const FitView& view) { return view.held_out; })) return;
    const auto pose = PoseByJoints(person, step.joints.x_in_world, step.joints.valid);
    if (pose) losses[i] = loss(step, SkinVertices(person.body, ToBodyPose(person.body, *pose)));
  });
  return losses;
}

/// What all vertices of one time step show, by vertex.
std::vector<SeenVertex> SeenIn(const PersonBody& person, const FitStep& step, bool held_out, const Eigen::Matrix3Xf& vertices,
                               double sigma_px) {
  std::vector<SeenVertex> all;
  for (const FitView& view : step.views) {
    if (!view.grey || view.held_out != held_out) continue;
    const auto seen =
        SeeVertices(person.body, vertices, view.camera, SmoothBrightness(*view.grey, view.outline->mask(), sigma_px));
    all.insert(all.end(), seen.begin(), seen.end());
  }
  return all;
}

struct ShiftSums {
  Eigen::Matrix2d h = Eigen::Matrix2d::Zero();
  Eigen::Vector2d g = Eigen::Vector2d::Zero();
};

ShiftSums ShiftOf(const PersonBody& person, const Eigen::Matrix3Xf& vertices, const FitView& view) {
  constexpr double kReachPx = 12;
  ShiftSums sums;
  for (const RimPoint& rim : FindRim(person.body.faces, vertices, view.camera)) {
    const auto gap = view.outline->Distance(rim.px, rim.outward, kReachPx);
    if (!gap) continue;
    sums.h += rim.outward * rim.outward.transpose(), sums.g += rim.outward * *gap;
  }
  return sums;
}

/// One silhouette of a camera.
struct CameraView {
  bool used = false;
  double before = kNan, after = kNan;
  ShiftSums shift;
};

/// Over the silhouettes in use; where none is, over all of them: what is wrong with such a camera is what one wants to know.
CameraFit Summary(const std::string& name, const std::vector<CameraView>& views) {
  const auto used = std::count_if(views.begin(), views.end(), [](const CameraView& view) { return view.used; });
  CameraFit fit{name, static_cast<int>(views.size()), static_cast<int>(static_cast<int64_t>(views.size()) - used)};
  std::vector<double> before, after, x, y;
  for (const CameraView& view : views) {
    if (used > 0 && !view.used) continue;
    before.push_back(view.before), after.push_back(view.after);
    if (!(view.shift.h.determinant() > 1)) continue;
    const Eigen::Vector2d shift = view.shift.h.inverse() * view.shift.g;
    x.push_back(shift[0]), y.push_back(shift[1]);
  }
  fit.iou_before = Mean(FiniteValues(before)), fit.iou = Mean(FiniteValues(after));
  if (x.size() < 2) return fit;
  fit.shift_px = {LinearQuantile(x, 0.5), LinearQuantile(y, 0.5)};
  fit.shift_sigma_px = std::hypot(SampleDeviation(x), SampleDeviation(y)) / std::sqrt(static_cast<double>(x.size()));
  return fit;
}

}  // namespace

double SilhouetteIou(const BodyTemplate& body, const Eigen::Matrix3Xf& vertices_in_world, const FitView& view) {
  const Image cover = RasterizeCover(body.faces, vertices_in_world, view.camera);
  const Image& mask = view.outline->mask();
  int64_t both = 0, any = 0;
  for (size_t i = 0; i < cover.pixels.size(); ++i) {
    const bool a = cover.pixels[i] > 0, b = mask.pixels[i] >= 128;
    both += a && b, any += a || b;
  }
  return any > 0 ? static_cast<double>(both) / static_cast<double>(any) : 0;
}

std::vector<double> OutlineLoss(const PersonBody& person, const std::vector<FitStep>& steps, const RunContext& run) {
  return HeldOutLosses(person, steps, run, [&](const FitStep& step, const Eigen::Matrix3Xf& vertices) {
    std::vector<double> ious;
    for (const FitView& view : step.views) {
      if (view.held_out) ious.push_back(SilhouetteIou(person.body, vertices, view));
    }
    return 1 - Mean(ious);
  });
}

std::vector<double> BrightnessLoss(const PersonBody& person, const std::vector<FitStep>& steps, double sigma_px,
                                   const RunContext& run) {
  std::vector<std::vector<SeenVertex>> seen(steps.size());
  ParallelFor(static_cast<int64_t>(steps.size()), run.num_threads, [&](int64_t i) {
    const auto pose = person.seen.find(steps[i].frame);
    if (pose == person.seen.end()) return;
    seen[i] = SeenIn(person, steps[i], false, SkinVertices(person.body, ToBodyPose(person.body, pose->second)), sigma_px);
  });
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(person.body.vertices.cols()), weight = sum;
  for (const auto& step : seen) {
    for (const SeenVertex& one : step) sum[one.vertex] += one.weight * one.value, weight[one.vertex] += one.weight;
  }
  return HeldOutLosses(person, steps, run, [&](const FitStep& step, const Eigen::Matrix3Xf& vertices) {
    double deviations = 0, total = 0;
    for (const SeenVertex& one : SeenIn(person, step, true, vertices, sigma_px)) {
      if (!(weight[one.vertex] > 1)) continue;
      deviations += one.weight * std::abs(one.value - sum[one.vertex] / weight[one.vertex]), total += one.weight;
    }
    return total > 0 ? deviations / total : kNan;
  });
}

std::vector<double> StepIous(const BodyTemplate& body, const ArticulatedPose& pose, const FitStep& step) {
  const Eigen::Matrix3Xf vertices = SkinVertices(body, ToBodyPose(body, pose));
  std::vector<double> ious;
  for (const FitView& view : step.views) ious.push_back(SilhouetteIou(body, vertices, view));
  return ious;
}

std::vector<std::vector<double>> ViewIous(const FitState& state, const std::vector<FitStep>& steps, const RunContext& run) {
  const BodyTemplate body = state.Shaped();
  std::vector<std::vector<double>> ious(steps.size());
  ParallelFor(static_cast<int64_t>(steps.size()), run.num_threads, [&](int64_t i) {
    const auto step = static_cast<int>(i);
    ious[i].assign(steps[i].views.size(), kNan);
    if (state.IsPosed(step)) ious[i] = StepIous(body, state.pose(step), steps[i]);
  });
  return ious;
}

std::vector<RejectedView> RejectViews(const std::vector<FitStep>& steps, const std::vector<std::vector<double>>& ious,
                                      std::vector<std::vector<uint8_t>>* used) {
  constexpr double kTimesMedian = 4, kFine = 0.15;  // of what does not overlap
  std::vector<double> values;
  const auto for_each = [&](const auto& use) {
    for (int i = 0; i < static_cast<int>(steps.size()); ++i) {
      for (int k = 0; k < static_cast<int>(ious[i].size()); ++k) {
        if ((*used)[i][k] && std::isfinite(ious[i][k])) use(i, k, ious[i][k]);
      }
    }
  };
  for_each([&](int, int, double iou) { values.push_back(iou); });
  const double least = 1 - std::max(kFine, kTimesMedian * (1 - LinearQuantile(values, 0.5)));
  std::vector<RejectedView> rejected;
  for_each([&](int i, int k, double iou) {
    if (iou >= least) return;
    (*used)[i][k] = 0;
    rejected.push_back({steps[i].frame, steps[i].views[k].camera_name, iou});
  });
  return rejected;
}

std::vector<CameraFit> CompareCameras(const PersonBody& person, const FitState& state, const std::vector<FitStep>& steps,
                                      const std::vector<std::vector<double>>& before, const RunContext& run) {
  const std::vector<std::vector<double>> after = ViewIous(state, steps, run);
  std::vector<std::vector<CameraView>> views(steps.size());
  ParallelFor(static_cast<int64_t>(steps.size()), run.num_threads, [&](int64_t i) {
    const auto step = static_cast<int>(i);
    if (!state.IsPosed(step)) return;
    const Eigen::Matrix3Xf vertices = SkinVertices(person.body, ToBodyPose(person.body, state.pose(step)));
    for (size_t k = 0; k < steps[i].views.size(); ++k) {
      views[i].push_back(
          {state.IsUsed(step, static_cast<int>(k)), before[i][k], after[i][k], ShiftOf(person, vertices, steps[i].views[k])});
    }
  });
  std::map<std::string, std::vector<CameraView>> cameras;
  for (size_t i = 0; i < steps.size(); ++i) {
    for (size_t k = 0; k < views[i].size(); ++k) cameras[steps[i].views[k].camera_name].push_back(views[i][k]);
  }
  std::vector<CameraFit> out;
  for (const auto& [name, seen] : cameras) out.push_back(Summary(name, seen));
  return out;
}

}  // namespace mvstudio::body
