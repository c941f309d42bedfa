#include "calib/bundle/mrcal_engine.h"

#include <sys/mman.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <mutex>
#include <set>

#include "calib/bundle/mrcal_problem.h"
#include "calib/bundle/rig_problem.h"
#include "core/check.h"
#include "core/error.h"

namespace mvstudio::calib {
namespace internal {
namespace {

/// libmrcal and libdogleg write to standard error and offer no hook: for the life of this object it goes to memory instead.
class CapturedStderr {
 public:
  CapturedStderr() {
    std::fflush(stderr);
    memory_ = memfd_create("stderr", MFD_CLOEXEC);
    saved_ = memory_ >= 0 ? dup(STDERR_FILENO) : -1;
    if (saved_ >= 0) dup2(memory_, STDERR_FILENO);
  }
  ~CapturedStderr() {
    Restore();
    if (memory_ >= 0) close(memory_);
  }
  CapturedStderr(const CapturedStderr&) = delete;
  CapturedStderr& operator=(const CapturedStderr&) = delete;

  /// Ends the capture. The last line of what was written, at most 400 bytes.
  std::string LastLine() {
    Restore();
    const off_t size = memory_ >= 0 ? lseek(memory_, 0, SEEK_END) : 0;
    std::string text(static_cast<size_t>(std::min<off_t>(size, 400)), '\0');
    if (text.empty() || pread(memory_, text.data(), text.size(), size - static_cast<off_t>(text.size())) < 0) return "";
    while (!text.empty() && text.back() == '\n') text.pop_back();
    return text.substr(text.rfind('\n') + 1);
  }

 private:
  void Restore() {
    std::fflush(stderr);
    if (saved_ < 0) return;
    dup2(saved_, STDERR_FILENO);
    close(saved_);
    saved_ = -1;
  }

  int memory_ = -1, saved_ = -1;
};

}  // namespace

bool Optimize(MrcalProblem* problem, std::string* message) {
  static std::mutex one_at_a_time;
  const std::lock_guard<std::mutex> lock(one_at_a_time);
  const mrcal_problem_constants_t ranges{1e-6, 1e6};  // of points, of which there are none
  CapturedStderr captured;
  const mrcal_stats_t stats = mrcal_optimize(
      nullptr, 0, nullptr, 0, problem->intrinsics.data(), problem->extrinsics.data(), problem->frames.data(), nullptr,
      &problem->warp, problem->num_lenses(), static_cast<int>(problem->extrinsics.size()),
      static_cast<int>(problem->frames.size()), 0, 0, problem->observations.data(), nullptr,
      static_cast<int>(problem->observations.size()), 0, problem->pool.data(), &problem->lens, problem->image_sizes.data(),
      problem->selections, &ranges, problem->spacing_m, problem->width, problem->height, false, false);
  *message = captured.LastLine();
  return stats.rms_reproj_error__pixels >= 0;
}

}  // namespace internal

namespace {

using geometry::LensModel;

constexpr double kMaxImprovement = 1e-5;  // of the sum of squares, by one more step; beyond it mrcal stopped too early
constexpr double kNegligiblePx = 1e-5;    // an improvement of the root mean square that does not count

bool InUse(const View& view) { return (view.weights.array() > 0).any(); }

bool Knows(LensModel model) {
  return model == LensModel::kPinhole || model == LensModel::kBrown4 || model == LensModel::kBrown5 ||
         model == LensModel::kRational8 || model == LensModel::kThinPrism12 || model == LensModel::kSplined;
}

std::string WhyNotLenses(const std::vector<View>& views, const RigState& state) {
  const geometry::Camera* first = nullptr;
  for (const View& view : views) {
    if (!InUse(view)) continue;
    const geometry::Camera& camera = state.cameras.at(view.camera_idx);
    if (!Knows(camera.model)) {
      return "mrcal has no lens model " + std::string(geometry::ToString(camera.model)) +
             "; it has pinhole, brown4, brown5, rational8, thinprism12 and splined";
    }
    if (!first) first = &camera;
    if (camera.model != first->model || !(camera.spline == first->spline)) {
      return "mrcal solves cameras with the same lens model only; " + first->name + " has " +
             std::string(geometry::ToString(first->model)) + ", " + camera.name + " has " +
             std::string(geometry::ToString(camera.model)) + (camera.model == first->model ? " with another grid" : "");
    }
  }
  return "";
}

std::string WhyNotBoards(const std::vector<View>& views, const MrcalOptions& options) {
  std::set<int> used;
  for (const View& view : views) {
    if (InUse(view)) used.insert(view.board);
  }
  if (used.size() > 1) return "mrcal knows one board; " + std::to_string(used.size()) + " were seen";
  if (used.empty()) return "";
  MVS_CHECK(*used.begin() >= 0 && *used.begin() < static_cast<int>(options.boards.size()), "board " << *used.begin());
  const Board& board = options.boards[*used.begin()];
  const bool grid = board.kind == Board::Kind::kChessboard || board.kind == Board::Kind::kCharuco ||
                    board.kind == Board::Kind::kGrid || board.kind == Board::Kind::kCircles;
  if (grid && board.row_step_m == 0 && board.cols > 1 && board.rows > 1 && board.num_corners() == board.cols * board.rows)
    return "";
  return "mrcal knows full grids of equally spaced corners only; the board is " + ToString(board);
}

bool Any(const std::vector<bool>& flags) {
  for (bool flag : flags) {
    if (flag) return true;
  }
  return false;
}

/// False when a corner with a weight does not project.
bool Projects(const std::vector<View>& views, const RigState& state) {
  const auto residuals = BundleResiduals(views, state);
  for (size_t v = 0; v < views.size(); ++v) {
    for (Eigen::Index i = 0; i < views[v].size(); ++i) {
      if (views[v].weights[i] > 0 && !residuals[v].col(i).allFinite()) return false;
    }
  }
  return true;
}

/// Relative decrease of the sum of squares that a Gauss-Newton step from here promises.
double PossibleImprovement(const std::vector<View>& views, const RigState& state, const BundleOptions& options) {
  RigProblem problem(views, state, options);
  SchurSystem system;
  problem.AllocateSystem(&system);
  problem.Try(Eigen::VectorXd::Zero(problem.columns().total), Eigen::MatrixXd::Zero(system.block_dim(), system.num_blocks()));
  if (!problem.LinearizeTrial(&system)) return 1;
  double weights = 0;
  for (const View& view : views) weights += view.weights.sum();
  constexpr double kDamping = 1e-12;  // directions that the data leave open promise nothing
  double decrease = 0;
  for (int b = 0; b < system.num_blocks(); ++b) {
    Eigen::MatrixXd h = system.block_h.middleCols(static_cast<Eigen::Index>(b) * system.block_dim(), system.block_dim());
    h.diagonal() *= 1 + kDamping;
    decrease += system.block_g.col(b).dot(h.selfadjointView<Eigen::Lower>().ldlt().solve(system.block_g.col(b)));
  }
  ReducedSystem reduced = Reduce(system, kDamping, options.num_threads);
  reduced.h.diagonal() *= 1 + kDamping;
  if (reduced.g.size() > 0) decrease += reduced.g.dot(reduced.h.selfadjointView<Eigen::Lower>().ldlt().solve(reduced.g));
  return decrease < kNegligiblePx * kNegligiblePx * weights ? 0 : decrease / system.cost;
}

void Summarize(const std::vector<View>& views, const std::vector<View>& start, const RigState& state, int num_unknowns,
               BundleReport* report) {
  const auto residuals = BundleResiduals(views, state);
  double sum = 0;
  for (size_t v = 0; v < views.size(); ++v) {
    for (Eigen::Index i = 0; i < views[v].size(); ++i) {
      report->num_rejected += start[v].weights[i] > 0 && views[v].weights[i] <= 0;
      if (views[v].weights[i] <= 0) continue;
      sum += residuals[v].col(i).squaredNorm();
      report->num_corners += 1;
    }
  }
  report->rms_px = std::sqrt(sum / std::max(1, report->num_corners));
  report->sigma_px = std::sqrt(sum / std::max(1, 2 * report->num_corners - num_unknowns));
}

}  // namespace

std::string WhyNotMrcal(const std::vector<View>& views, const RigState& state, const MrcalOptions& options) {
  const std::string lenses = WhyNotLenses(views, state);
  if (!lenses.empty()) return lenses;
  const std::string boards = WhyNotBoards(views, options);
  if (!boards.empty()) return boards;
  if (options.bundle.refine_time) return "mrcal knows no time offsets between cameras";
  for (double offset : state.time_offset_frames) {
    if (offset != 0) return "mrcal knows no time offsets between cameras";
  }
  if (Any(options.bundle.fix_lens) || Any(options.bundle.fix_camera))
    return "mrcal fixes the lenses or poses of all cameras or of none";
  return "";
}

BundleReport SolveWithMrcal(std::vector<View>* views, RigState* state, const MrcalOptions& options) {
  const std::string why_not = WhyNotMrcal(*views, *state, options);
  if (!why_not.empty()) throw UsageError(why_not);
  if (const auto failed = internal::CheckInput(*views, *state)) return *failed;
  if (!Projects(*views, *state))
    return internal::Failed(Status::kBehindCamera, "the start of the adjustment puts corners behind a camera");
  internal::MrcalProblem problem = internal::MakeMrcalProblem(*views, *state, options);
  const std::vector<View> start = *views;
  std::string said;
  if (!internal::Optimize(&problem, &said)) return internal::Failed(Status::kNotConverged, "mrcal gave up: " + said);
  internal::ToState(problem, options.bundle.gauge, views, state);
  if (!Projects(*views, *state))
    return internal::Failed(Status::kNotConverged, "mrcal's solution puts corners behind a camera");
  BundleReport report;
  Summarize(*views, start, *state, problem.num_states(), &report);
  if (problem.selections.do_apply_regularization) return report;
  const double improvement = PossibleImprovement(*views, *state, options.bundle);
  if (improvement > kMaxImprovement) {
    report.status = Status::kNotConverged;
    report.message =
        "mrcal stopped early: one more step would lower the sum of squares by a share of " + std::to_string(improvement);
  }
  return report;
}

}  // namespace mvstudio::calib
