#include "calib/intrinsics.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "calib/homography.h"
#include "calib/resection.h"

namespace mvstudio::calib {
namespace {

using geometry::Camera;
using geometry::LensModel;

constexpr int kMaxStartViews = 16;
constexpr double kStartFocals[] = {0.6, 0.9, 1.3, 2.0, 3.5};  // of the image width, beside the closed form

/// At most `count` views with corners, evenly spread.
std::vector<View> Thin(const std::vector<View>& views, size_t count) {
  if (views.size() <= count) return views;
  std::vector<View> thinned;
  for (size_t i = 0; i < count; ++i) thinned.push_back(views[i * views.size() / count]);
  return thinned;
}

MonoSolution Failed(Status status, const std::string& message) {
  MonoSolution solution;
  solution.status = status;
  solution.message = message;
  return solution;
}

/// Poses of all boards for given intrinsics; views without one lose their weights. Returns how many boards have a pose.
int ResectAll(MonoSolution* solution) {
  int count = 0;
  for (View& view : solution->views) {
    const Resection resection = ResectPlane(solution->state.cameras[0], view);
    if (resection.status == Status::kOk || resection.status == Status::kNotConverged) {
      solution->state.world_from_board[view.frame] = resection.cam_from_board;
      ++count;
    } else {
      view.weights.setZero();
    }
  }
  return count;
}

MonoSolution StartFrom(const Camera& camera, double focal_px, const std::vector<View>& views,
                       const std::vector<int64_t>& frames) {
  MonoSolution solution;
  Camera start = geometry::MakePinhole(camera.name, camera.width_px, camera.height_px, focal_px);
  start = WithModel(start, camera.model);
  solution.state = {{start}, {geometry::Rigid3()}, frames, std::vector<geometry::Rigid3>(frames.size())};
  solution.views = views;
  for (View& view : solution.views) view.camera_idx = 0;
  if (ResectAll(&solution) == 0) solution.status = Status::kDegenerate;
  return solution;
}

void Solve(const BundleOptions& options, MonoSolution* solution) {
  BundleOptions mono = options;
  mono.gauge = Gauge();
  mono.refine_cameras = false;
  solution->bundle = SolveBundle(&solution->views, &solution->state, mono);
  solution->status = solution->bundle.status;
  solution->message = solution->bundle.message;
}

/// A solution a camera can have: finite, positive focal lengths of a sensible size.
bool Plausible(const MonoSolution& solution) {
  if (solution.status != Status::kOk && solution.status != Status::kNotConverged) return false;
  const Camera& camera = solution.state.cameras[0];
  const double size = std::max(camera.width_px, camera.height_px);
  return camera.params.allFinite() && std::min(camera.fx(), camera.fy()) > 0.05 * size &&
         std::max(camera.fx(), camera.fy()) < 200 * size;
}

/// The start focal length whose short adjustment ends with the smallest error.
double BestStart(const Camera& camera, const std::vector<View>& views, const std::vector<int64_t>& frames) {
  const std::vector<View> some = Thin(views, kMaxStartViews);
  const FocalGuess guess = GuessFocal(views, camera.width_px, camera.height_px);
  std::vector<double> focals;
  if (guess.status == Status::kOk) focals.push_back(guess.focal_px);
  for (double factor : kStartFocals) focals.push_back(factor * std::max(camera.width_px, camera.height_px));
  BundleOptions options;
  options.max_iterations = 15;
  options.reject_outliers = false;
  Camera simple = camera;
  if (camera.model != LensModel::kKannalaBrandt4 && camera.model != LensModel::kPinhole) simple.model = LensModel::kBrown1;
  double best_focal = 0, best_rms = std::numeric_limits<double>::infinity();
  for (double focal : focals) {
    MonoSolution solution = StartFrom(simple, focal, some, frames);
    if (solution.status != Status::kOk) continue;
    Solve(options, &solution);
    if (!Plausible(solution)) continue;
    if (solution.bundle.rms_px < 0.98 * best_rms)
      best_rms = solution.bundle.rms_px, best_focal = solution.state.cameras[0].fx();
    if (best_rms < 1) break;
  }
  return best_focal;
}

}  // namespace

FocalGuess GuessFocal(const std::vector<View>& views, int width_px, int height_px) {
  const Eigen::Vector2d center((width_px - 1) / 2.0, (height_px - 1) / 2.0);
  double numerator = 0, denominator = 0, scale = 0;
  int used = 0;
  for (const View& view : views) {
    const Eigen::Matrix2Xd centered = (view.px.colwise() - center) / width_px;
    const auto homography = FitHomography(view.x_in_board.topRows<2>(), centered);
    if (!homography) continue;
    const Eigen::Vector3d a = homography->col(0), b = homography->col(1);
    const double size = a.head<2>().squaredNorm() + b.head<2>().squaredNorm();
    // (a.xy . b.xy) w + a.z b.z = 0 and (|a.xy|^2 - |b.xy|^2) w + a.z^2 - b.z^2 = 0 with w = 1 / f^2, in units of the size
    const double left[2] = {2 * a.head<2>().dot(b.head<2>()) / size,
                            (a.head<2>().squaredNorm() - b.head<2>().squaredNorm()) / size};
    const double right[2] = {-2 * a.z() * b.z() / size, -(a.z() * a.z() - b.z() * b.z()) / size};
    for (int k = 0; k < 2; ++k) numerator += left[k] * right[k], denominator += left[k] * left[k];
    scale += left[0] * left[0] + left[1] * left[1];
    ++used;
  }
  if (used == 0) return {Status::kTooFewViews, 0};
  const double w = denominator > 0 ? numerator / denominator : 0;
  if (!(scale / used > 1e-6) || !(w > 1e-4)) return {Status::kDegenerate, 0};
  return {Status::kOk, width_px / std::sqrt(w)};
}

Camera WithModel(const Camera& camera, LensModel model) {
  Camera result = camera;
  result.model = model;
  result.params = Eigen::VectorXd::Zero(geometry::NumParams(model));
  const bool same_family = (camera.model == LensModel::kKannalaBrandt4) == (model == LensModel::kKannalaBrandt4);
  const Eigen::Index kept = same_family ? std::min(result.params.size(), camera.params.size()) : 4;
  result.params.head(kept) = camera.params.head(kept);
  return result;
}

MonoSolution CalibrateMono(const Camera& camera, const std::vector<View>& views, const std::vector<int64_t>& frames,
                           const BundleOptions& options) {
  if (views.empty()) return Failed(Status::kTooFewViews, "camera " + camera.name + " never sees the board");
  for (const View& view : views) {
    if (!view.px.allFinite())
      return Failed(Status::kNonFiniteInput, "camera " + camera.name + ": a corner is not a finite number");
  }
  const double focal = BestStart(camera, views, frames);
  if (!(focal > 0)) {
    return Failed(Status::kDegenerate, "camera " + camera.name + ": no focal length explains its " +
                                           std::to_string(views.size()) +
                                           " boards; show the board tilted in several directions");
  }
  MonoSolution solution = StartFrom(camera, focal, views, frames);
  if (solution.status != Status::kOk) return Failed(Status::kDegenerate, "camera " + camera.name + ": no board pose found");
  Solve(options, &solution);
  if (!solution.message.empty()) solution.message = "camera " + camera.name + ": " + solution.message;
  return solution;
}

MonoSolution RefineMono(const MonoSolution& start, LensModel model, const BundleOptions& options) {
  MonoSolution solution = start;
  solution.state.cameras[0] = WithModel(start.state.cameras[0], model);
  Solve(options, &solution);
  return solution;
}

}  // namespace mvstudio::calib
