#include "calib/lens/intrinsics.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "calib/board/homography.h"
#include "calib/board/space_points.h"
#include "calib/bundle/rig_problem.h"
#include "calib/lens/evidence.h"
#include "calib/lens/gross_errors.h"
#include "calib/lens/resection.h"
#include "core/statistics.h"
#include "geometry/lens/lens_fit.h"

namespace mvstudio::calib {
namespace {

using geometry::Camera;
using geometry::LensModel;

constexpr int kMaxStartViews = 16;
constexpr double kStartFocals[] = {0.6, 0.9, 1.3, 2.0, 3.5, 10, 40, 150};  // of the image width, beside the closed form
constexpr double kStartFieldsDeg[] = {100, 140, 180, 220, 260};            // horizontal fields of view of fisheye starts
constexpr double kFlatDeg = 10;                      // boards tilted less than this count as parallel to the image
constexpr double kCap = 5e-3, kGoodSolution = 5e-4;  // of the image width
constexpr double kLongestOther = 5;                  // of the image width: longer lenses have almost no distortion that
                                                     // misleads
constexpr double kGoodStart = 2e-3;                  // median error over the image width below which wider lenses are not tried

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

MonoSolution StartFrom(const Camera& camera, const std::vector<View>& views) {
  MonoSolution solution;
  solution.state.cameras = {camera};
  solution.state.cam_from_world = {geometry::Rigid3()};
  solution.views = views;
  int boards = 1;
  for (size_t v = 0; v < views.size(); ++v) {
    solution.views[v].camera_idx = 0;
    solution.views[v].frame = static_cast<int>(v);
    solution.state.frames.push_back(static_cast<int64_t>(v));
    solution.prior.push_back(views[v].weights);
    boards = std::max(boards, views[v].board + 1);
  }
  solution.state.world_from_board.resize(views.size());
  solution.state.rig_from_board.resize(boards);
  solution.state.board_warp_m.assign(boards, Eigen::Vector2d::Zero());
  if (ResectAll(&solution) == 0) solution.status = Status::kDegenerate;
  return solution;
}

void Solve(const BundleOptions& options, MonoSolution* solution) {
  BundleOptions mono = options;
  mono.gauge = Gauge();
  mono.refine_cameras = mono.refine_boards = mono.refine_warp = mono.refine_time = false;
  mono.fix_lens.clear(), mono.fix_camera.clear();
  solution->bundle = SolveBundle(&solution->views, &solution->state, mono);
  solution->status = solution->bundle.status;
  solution->message = solution->bundle.message;
}

/// A solution a camera can have: finite, positive focal lengths of a sensible size.
bool Plausible(const MonoSolution& solution) {
  if (solution.status != Status::kOk && solution.status != Status::kNotConverged) return false;
  const Camera& camera = solution.state.cameras[0];
  const double size = std::max(camera.width_px, camera.height_px);
  return geometry::WhyInvalidLens(camera).empty() && std::min(camera.fx(), camera.fy()) > 0.05 * size &&
         std::max(camera.fx(), camera.fy()) < 1000 * size;
}

/// Median error of all corners, those included whose board has no pose (infinite).
double MedianError(const MonoSolution& solution) {
  const auto residuals = BundleResiduals(solution.views, solution.state);
  std::vector<double> errors;
  for (size_t v = 0; v < residuals.size(); ++v) {
    const bool posed = (solution.views[v].weights.array() > 0).any();
    for (Eigen::Index i = 0; i < residuals[v].cols(); ++i)
      errors.push_back(posed ? residuals[v].col(i).norm() : std::numeric_limits<double>::infinity());
  }
  return UpperMedian(errors, std::numeric_limits<double>::infinity());
}

bool Usable(const MonoSolution& solution) { return solution.status == Status::kOk || solution.status == Status::kNotConverged; }

/// Boards without a corner that counts.
int NumLost(const MonoSolution& solution) {
  int lost = 0;
  for (const View& view : solution.views) lost += !(view.weights.array() > 0).any();
  return lost;
}

/// Mean squared error of all corners, errors above half a percent of the image and boards without a pose counting as that much.
double MeanCappedSquare(const MonoSolution& solution) {
  if (solution.views.empty() || !Usable(solution)) return std::numeric_limits<double>::infinity();
  const Camera& camera = solution.state.cameras[0];
  const double cap = kCap * std::max(camera.width_px, camera.height_px);
  const auto residuals = BundleResiduals(solution.views, solution.state);
  double sum = 0;
  Eigen::Index count = 0;
  for (size_t v = 0; v < residuals.size(); ++v) {
    const bool posed = (solution.views[v].weights.array() > 0).any();
    for (Eigen::Index i = 0; i < residuals[v].cols(); ++i, ++count)
      sum += posed ? std::pow(std::fmin(cap, residuals[v].col(i).norm()), 2) : cap * cap;
  }
  return sum / static_cast<double>(std::max<Eigen::Index>(1, count));
}

/// Median error above which a solution may be a false minimum.
double GoodError(const Camera& camera) { return std::max(1.0, kGoodSolution * std::max(camera.width_px, camera.height_px)); }

MonoSolution Undetermined(const std::string& name, size_t num_boards) {
  return Failed(Status::kDegenerate, "camera " + name + ": its " + std::to_string(num_boards) +
                                         (num_boards == 1 ? " board does" : " boards do") +
                                         " not separate the focal length from the distance; show the board tilted in several "
                                         "directions");
}

/// Median angle between the boards and the image, degrees.
double MedianTiltDeg(const MonoSolution& solution) {
  Eigen::VectorXd tilts(static_cast<Eigen::Index>(solution.state.world_from_board.size()));
  for (Eigen::Index i = 0; i < tilts.size(); ++i) {
    const Eigen::Vector3d normal = solution.state.world_from_board[i].rotation * Eigen::Vector3d::UnitZ();
    tilts[i] = std::acos(std::min(1.0, std::abs(normal.z()))) * 180 / M_PI;
  }
  return tilts.size() ? Median(tilts) : 0;
}

struct Start {
  Camera camera;
  double error_px = std::numeric_limits<double>::infinity();
};

void TryStart(const Camera& camera, const std::vector<View>& views, Start* best) {
  MonoSolution solution = StartFrom(camera, views);
  if (solution.status != Status::kOk) return;
  BundleOptions options;
  options.max_iterations = 15;
  options.cost_tolerance = 1e-4;
  options.reject_outliers = false;
  Solve(options, &solution);
  if (!Plausible(solution)) return;
  const double error = MedianError(solution);
  if (error < 0.98 * best->error_px) *best = {solution.state.cameras[0], error};
}

Start BestStart(const Camera& camera, const std::vector<View>& views) {
  const std::vector<View> some = Thin(views, kMaxStartViews);
  const double size = std::max(camera.width_px, camera.height_px);
  const auto pinhole = [&](double focal_px) {
    return geometry::MakePinhole(camera.name, camera.width_px, camera.height_px, focal_px);
  };
  Start best;
  std::vector<double> focals;
  const FocalGuess guess = GuessFocal(views, camera.width_px, camera.height_px);
  if (guess.status == Status::kOk) focals.push_back(guess.focal_px);
  for (size_t v = 0; v < some.size() && focals.empty(); ++v) {
    if (const auto focal = FocalInSpace(some[v].x_in_board, some[v].px, camera.width_px, camera.height_px))
      focals.push_back(*focal);
  }
  for (double factor : kStartFocals) focals.push_back(factor * size);
  for (double focal : focals) {
    TryStart(WithModel(pinhole(focal), LensModel::kBrown1), some, &best);
    if (best.error_px < std::min(1.0, kGoodStart * size)) return best;
  }
  for (double field_deg : kStartFieldsDeg) {
    Camera fisheye = pinhole(size / (field_deg * M_PI / 180));
    fisheye.model = LensModel::kKannalaBrandt4;
    fisheye.params.conservativeResizeLike(Eigen::VectorXd::Zero(8));
    TryStart(fisheye, some, &best);
  }
  return best;
}

}  // namespace

FocalGuess GuessFocal(const std::vector<View>& views, int width_px, int height_px) {
  const Eigen::Vector2d center((width_px - 1) / 2.0, (height_px - 1) / 2.0);
  double numerator = 0, denominator = 0, scale = 0;
  int used = 0;
  for (const View& view : views) {
    if (SpansSpace(view.x_in_board)) continue;  // no homography
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
  if (!(scale / used > 1e-6) || !(w > 1e-7)) return {Status::kDegenerate, 0};
  return {Status::kOk, width_px / std::sqrt(w)};
}

Camera WithModel(const Camera& camera, LensModel model, const geometry::SplineGrid& spline) {
  if (camera.model == model && camera.spline == spline) return camera;
  const bool same_terms = geometry::HasOpenCvOrder(camera.model) && geometry::HasOpenCvOrder(model);
  if (!same_terms) {
    const geometry::LensFit fit = geometry::FitLens(camera, model, {}, spline);
    const bool usable = fit.status == Status::kOk || fit.status == Status::kNotConverged;
    if (usable && WithinBounds(fit.camera)) return fit.camera;
  }
  Camera result = camera;
  result.model = model;
  result.spline = spline;
  result.params = Eigen::VectorXd::Zero(geometry::NumParams(result));
  const geometry::LensTraits& traits = geometry::TraitsOf(model);
  for (int i = 0; i < traits.num_params; ++i) result.params[4 + i] = traits.params[i].start;
  const Eigen::Index kept = same_terms ? std::min(result.params.size(), camera.params.size()) : 4;
  result.params.head(kept) = camera.params.head(kept);
  return result;
}

namespace {

/// Starts of one model: the lens that gives the same image, and for models with two basins (double spheres) one in the middle
/// of each.
std::vector<Camera> StartsFor(const Camera& camera, LensModel model, const geometry::SplineGrid& spline) {
  std::vector<Camera> starts = {WithModel(camera, model, spline)};
  for (const Camera& start : geometry::BasinStarts(camera, model)) starts.push_back(start);
  return starts;
}

/// All boards posed by `lens`, then adjusted under `model`.
MonoSolution SolvePosed(const Camera& lens, LensModel model, const geometry::SplineGrid& spline, const std::vector<View>& views,
                        const std::vector<View>& screened, const BundleOptions& options) {
  MonoSolution posed = StartFrom(lens, screened);
  if (posed.status != Status::kOk) return Failed(Status::kDegenerate, "no board pose found");
  for (size_t v = 0; v < views.size(); ++v) {
    posed.prior[v] = views[v].weights;
    if ((posed.views[v].weights.array() > 0).any()) posed.views[v].weights = views[v].weights;
  }
  MonoSolution solution;
  for (const Camera& start : StartsFor(lens, model, spline)) {
    MonoSolution trial = posed;
    trial.state.cameras[0] = start;
    Solve(options, &trial);
    if (solution.views.empty() || (Usable(trial) && MedianError(trial) < MedianError(solution))) solution = std::move(trial);
  }
  return solution;
}

/// The same; then all boards are posed again by the solved lens while that helps: an early lens may have taken the wrong one of
/// a plane's two orientations, and rejected the board for it.
MonoSolution SolveFrom(const Camera& lens, LensModel model, const geometry::SplineGrid& spline, const std::vector<View>& views,
                       const std::vector<View>& screened, const BundleOptions& options) {
  constexpr int kRounds = 4;
  constexpr double kWorthIt = 0.99;
  MonoSolution solution = SolvePosed(lens, model, spline, views, screened, options);
  for (int round = 0; round < kRounds && Usable(solution) && NumLost(solution) > 0; ++round) {
    MonoSolution again = SolvePosed(solution.state.cameras[0], model, spline, views, screened, options);
    if (!Usable(again) || !(MeanCappedSquare(again) < kWorthIt * MeanCappedSquare(solution))) break;
    solution = std::move(again);
  }
  return solution;
}

/// May the solution be a false minimum?
bool PoorStart(const Camera& camera, const MonoSolution& solution) { return !(MedianError(solution) < GoodError(camera)); }

/// A start, and the best of all focal lengths under a lens without decentring.
std::vector<Camera> SymmetricStarts(const Camera& camera, const std::vector<View>& views) {
  const std::vector<View> some = Thin(views, kMaxStartViews);
  const double size = std::max(camera.width_px, camera.height_px);
  Start best;
  for (double factor : kStartFocals) {
    const Camera pinhole = geometry::MakePinhole(camera.name, camera.width_px, camera.height_px, factor * size);
    if (factor <= kLongestOther) TryStart(WithModel(pinhole, LensModel::kBrown2), some, &best);
  }
  std::vector<Camera> starts = {camera};
  if (std::isfinite(best.error_px)) starts.push_back(best.camera);
  return starts;
}

}  // namespace

double LargestAngle(const Camera& camera, const std::vector<View>& views) {
  const geometry::Projector projector(camera);
  double smallest_cosine = 1;
  for (const View& view : views) {
    for (Eigen::Index i = 0; i < view.size(); ++i) {
      const geometry::Unprojection ray = projector.Unproject(view.px.col(i));
      if (view.weights[i] > 0 && ray.status == Status::kOk) smallest_cosine = std::min(smallest_cosine, ray.ray_in_cam.z());
    }
  }
  return std::acos(smallest_cosine);
}

MonoSolution RefineMono(const Camera& camera, const std::vector<View>& views, const BundleOptions& options) {
  if (views.empty()) return Failed(Status::kTooFewViews, "camera " + camera.name + " never sees the board");
  MonoSolution solution = StartFrom(camera, views);
  if (solution.status != Status::kOk) {
    return Failed(Status::kDegenerate, "camera " + camera.name + ": the given lens explains none of its " +
                                           std::to_string(views.size()) + " boards; is it the right calibration?");
  }
  Solve(options, &solution);
  if (!solution.message.empty()) solution.message = "camera " + camera.name + ": " + solution.message;
  return solution;
}

MonoSolution CalibrateMono(const Camera& camera, const std::vector<View>& views, const BundleOptions& options,
                           bool keep_model) {
  if (views.empty()) return Failed(Status::kTooFewViews, "camera " + camera.name + " never sees the board");
  for (const View& view : views) {
    if (!view.px.allFinite())
      return Failed(Status::kNonFiniteInput, "camera " + camera.name + ": a corner is not a finite number");
  }
  std::vector<View> screened = views;
  for (View& view : screened) ScreenView(&view);
  const auto in_space = [](const View& view) { return SpansSpace(view.x_in_board, view.weights); };
  const bool space = std::any_of(screened.begin(), screened.end(), in_space);
  if (views.size() < 2 && !space) return Undetermined(camera.name, views.size());
  const Start start = BestStart(camera, screened);
  if (!std::isfinite(start.error_px)) {
    return Failed(Status::kDegenerate, "camera " + camera.name + ": no focal length explains its " +
                                           std::to_string(views.size()) +
                                           " boards; show the board tilted in several directions");
  }
  const bool wide = geometry::IsWide(start.camera.model);
  const LensModel model = keep_model ? camera.model : wide ? LensModel::kKannalaBrandt4 : LensModel::kBrown4;
  const geometry::SplineGrid spline = keep_model ? camera.spline : geometry::SplineGrid();
  MonoSolution solution = SolveFrom(start.camera, model, spline, views, screened, options);
  // Decentring gives a poor start false freedom, and too few terms leave boards in the wrong one of a plane's orientations.
  for (const Camera& lens : PoorStart(camera, solution) ? SymmetricStarts(start.camera, screened) : std::vector<Camera>()) {
    const MonoSolution symmetric = SolveFrom(lens, LensModel::kBrown2, {}, views, screened, options);
    if (!Usable(symmetric)) continue;
    const MonoSolution trial = SolveFrom(symmetric.state.cameras[0], model, spline, views, screened, options);
    if (MeanCappedSquare(trial) < MeanCappedSquare(solution)) solution = trial;
    if (!PoorStart(camera, solution)) break;
  }
  if (solution.status == Status::kDegenerate && solution.views.empty())
    return Failed(Status::kDegenerate, "camera " + camera.name + ": no board pose found");
  if (!solution.message.empty()) solution.message = "camera " + camera.name + ": " + solution.message;
  const auto evidence = FocalEvidence(solution);
  if (Usable(solution)) {
    // Tilted boards that say little alone may say enough together with the other cameras.
    if (options.lens_prior.empty() && evidence && *evidence < kMinFocalEvidence && !space && MedianTiltDeg(solution) < kFlatDeg)
      return Undetermined(camera.name, views.size());
  }
  return solution;
}

}  // namespace mvstudio::calib
