#include "triangulate/sync/refine_offsets.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <tuple>

#include "core/parallel.h"
#include "core/statistics.h"
#include "triangulate/point/linear.h"
#include "triangulate/sync/joint_tracks.h"
#include "triangulate/sync/offset_sigma.h"
#include "triangulate/sync/pair_curves.h"
#include "triangulate/sync/timed_points.h"

namespace mvstudio::triangulate::internal {
namespace {

constexpr int64_t kMaxFrames = 400;

struct State {
  std::vector<double> offset_frames;  // in the middle of the take; NaN: takes no part
  std::vector<int> whole_frames;      // of the offsets where it began; says which samples have neighbours, whatever the steps
  std::vector<double> drift_frames;   // by how much the offset is larger at the end of the take
  std::vector<bool> drifts;           // whether that is estimated
  std::vector<Eigen::Vector2d> shift_px;
  double scale_px = 0;  // robust standard deviation of a residual's coordinate
};

std::optional<TimedView> See(const PreparedRig& rig, size_t camera_idx, const JointTrack& track, double frame,
                             const State& state) {
  const auto sample = SampleTrack(track, frame);
  if (!sample) return std::nullopt;
  Status rejected;
  const auto views =
      MakeViews(rig, {{static_cast<int>(camera_idx), sample->px - state.shift_px[camera_idx], 1.0, 1.0}}, &rejected);
  if (views.empty()) return std::nullopt;
  return TimedView{views.front(), camera_idx, sample->px_per_frame};
}

/// Cauchy weights at three robust standard deviations; a fixed number of reweighted Gauss-Newton steps.
bool Triangulate(double scale_px, TimedPoint* point) {
  constexpr int kSteps = 6;
  std::vector<View> views;
  for (const TimedView& seen : point->views) views.push_back(seen.view);
  const LinearPoint start = WeightedLinear(views);
  if (start.status != Status::kOk) return false;
  point->x_in_local = start.x_in_local;
  for (int step = 0; step < kSteps; ++step) {
    Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
    for (TimedView& seen : point->views) {
      const auto residual = Evaluate(seen, point->x_in_local);
      if (!residual) return false;
      seen.weight = scale_px > 0 ? 1 / (1 + residual->px.squaredNorm() / (9 * scale_px * scale_px)) : 1;
      information += seen.weight * residual->d_px_d_x.transpose() * residual->d_px_d_x;
      gradient += seen.weight * residual->d_px_d_x.transpose() * residual->px;
    }
    const Eigen::LDLT<Eigen::Matrix3d> factor(information);
    if (factor.info() != Eigen::Success || !(factor.rcond() > 1e-9)) return false;
    point->x_in_local += factor.solve(gradient);
  }
  return point->x_in_local.allFinite();
}

struct Problem {
  const PreparedRig* rig;
  const Tracks* tracks;
  std::vector<int> frames;                   // of the reference's clock, thinned
  double stride = 1;                         // of the thinning
  double middle_frame = 0, half_frames = 1;  // of the take
  size_t num_persons = 0, num_joints = 0;
  double repeats = 1;  // of a detection, by resampling
};

Problem MakeProblem(const PreparedRig& rig, const Tracks& tracks, const std::vector<int>& frames, double repeats) {
  const int64_t count = static_cast<int64_t>(frames.size()), kept = std::min(count, kMaxFrames);
  Problem problem{&rig, &tracks, {}, static_cast<double>(count) / static_cast<double>(std::max<int64_t>(1, kept))};
  problem.repeats = repeats;
  if (count > 0) problem.middle_frame = 0.5 * (frames.front() + frames.back());
  if (count > 1) problem.half_frames = 0.5 * (frames.back() - frames.front());
  for (int64_t k = 0; k < kept; ++k) problem.frames.push_back(frames[static_cast<size_t>(k * count / kept)]);
  for (const auto& camera : tracks) {
    problem.num_persons = std::max(problem.num_persons, camera.size());
    for (const auto& person : camera) problem.num_joints = std::max(problem.num_joints, person.size());
  }
  return problem;
}

void MakePointsOfFrame(const Problem& problem, const State& state, size_t index, std::vector<TimedPoint>* points) {
  for (size_t p = 0; p < problem.num_persons; ++p) {
    for (size_t j = 0; j < problem.num_joints; ++j) {
      TimedPoint point;
      point.frame = problem.frames[index], point.person_idx = p, point.joint_idx = j;
      point.index = static_cast<int>(index);
      point.at = (point.frame - problem.middle_frame) / problem.half_frames;
      point.block = static_cast<int>(index * kSyncBlocks / problem.frames.size());
      for (size_t c = 0; c < problem.tracks->size(); ++c) {
        const auto& camera = (*problem.tracks)[c];
        if (std::isnan(state.offset_frames[c]) || p >= camera.size() || j >= camera[p].size()) continue;
        const double offset = state.offset_frames[c] + point.at * state.drift_frames[c];
        if (!HasNeighbours(camera[p][j], point.frame + state.whole_frames[c])) continue;
        auto seen = See(*problem.rig, c, camera[p][j], point.frame + offset, state);
        if (seen) point.views.push_back(*seen);
      }
      if (point.views.size() >= 2 && Triangulate(state.scale_px, &point)) points->push_back(std::move(point));
    }
  }
}

std::vector<TimedPoint> MakePoints(const Problem& problem, const State& state, int num_threads) {
  std::vector<std::vector<TimedPoint>> of_frame(problem.frames.size());
  ParallelFor(static_cast<int64_t>(of_frame.size()), num_threads,
              [&](int64_t i) { MakePointsOfFrame(problem, state, static_cast<size_t>(i), &of_frame[static_cast<size_t>(i)]); });
  std::vector<TimedPoint> points;
  for (auto& each : of_frame) points.insert(points.end(), each.begin(), each.end());
  return points;
}

void AddResiduals(const TimedPoint& point, std::vector<double>* residuals) {
  for (const TimedView& seen : point.views) {
    const auto residual = Evaluate(seen, point.x_in_local);
    if (residual) residuals->push_back(residual->px.norm());
  }
}

/// Median |residual| over all views.
double MedianResidual(const std::vector<TimedPoint>& points) {
  std::vector<double> residuals;
  for (const TimedPoint& point : points) AddResiduals(point, &residuals);
  return UpperMedian(std::move(residuals));
}

bool SameViews(const TimedPoint& a, const TimedPoint& b) {
  return std::equal(a.views.begin(), a.views.end(), b.views.begin(), b.views.end(),
                    [](const TimedView& p, const TimedView& q) { return p.camera_idx == q.camera_idx; });
}

/// The same for two sets of offsets, over the points that the same cameras see under both.
void CompareResiduals(const std::vector<TimedPoint>& before, const std::vector<TimedPoint>& after, double* before_px,
                      double* after_px) {
  const auto key = [](const TimedPoint& p) { return std::make_tuple(p.frame, p.person_idx, p.joint_idx); };
  std::vector<double> in_before, in_after;
  for (size_t i = 0, k = 0; i < before.size() && k < after.size();) {
    const auto a = key(before[i]), b = key(after[k]);
    if (a == b && SameViews(before[i], after[k])) AddResiduals(before[i], &in_before), AddResiduals(after[k], &in_after);
    i += a <= b, k += b <= a;
  }
  *before_px = UpperMedian(std::move(in_before));
  *after_px = UpperMedian(std::move(in_after));
}

/// Normal equations in the offsets and shifts, points eliminated; gradients by block of the take.
struct Normal {
  Eigen::MatrixXd information;
  std::vector<Eigen::VectorXd> gradients;
  std::vector<Eigen::Index> held;  // unknowns that stay where they are
};

void AddPoint(const TimedPoint& point, Normal* normal) {
  const auto equations = EquationsOf(point);
  if (!equations) return;
  Eigen::Vector3d x_gradient = Eigen::Vector3d::Zero();
  std::vector<Eigen::Matrix<double, 3, kClockParams>> cross;
  Eigen::VectorXd& gradient = normal->gradients[static_cast<size_t>(point.block)];
  std::vector<Eigen::Index> at;
  for (size_t i = 0; i < point.views.size(); ++i) {
    const TimedView& seen = point.views[i];
    const auto& by_x = equations->by_x[i];
    const auto& by_clock = equations->by_clock[i];
    const Eigen::Index first = kClockParams * static_cast<Eigen::Index>(seen.camera_idx);
    x_gradient += seen.weight * by_x.transpose() * equations->px[i];
    cross.push_back(seen.weight * by_x.transpose() * by_clock);
    at.push_back(first);
    normal->information.block<kClockParams, kClockParams>(first, first) += seen.weight * by_clock.transpose() * by_clock;
    gradient.segment<kClockParams>(first) += seen.weight * by_clock.transpose() * equations->px[i];
  }
  const Eigen::Matrix3d& inverse = equations->x_covariance;
  for (size_t i = 0; i < cross.size(); ++i) {
    gradient.segment<kClockParams>(at[i]) -= cross[i].transpose() * inverse * x_gradient;
    for (size_t k = 0; k < cross.size(); ++k) {
      normal->information.block<kClockParams, kClockParams>(at[i], at[k]) -= cross[i].transpose() * inverse * cross[k];
    }
  }
}

/// Keeps an unknown where it is.
void Hold(Eigen::Index i, Normal* normal) {
  normal->information.row(i).setZero();
  normal->information.col(i).setZero();
  normal->information(i, i) = 1;
  for (auto& gradient : normal->gradients) gradient[i] = 0;
  normal->held.push_back(i);
}

Normal MakeNormal(const std::vector<TimedPoint>& points, const State& state, size_t reference_idx) {
  const Eigen::Index size = kClockParams * static_cast<Eigen::Index>(state.offset_frames.size());
  Normal normal{Eigen::MatrixXd::Zero(size, size), std::vector<Eigen::VectorXd>(kSyncBlocks, Eigen::VectorXd::Zero(size)), {}};
  for (const TimedPoint& point : points) AddPoint(point, &normal);
  // Shifts are free within twice the noise: one more observation of weight (s / 2 s)^2 each.
  constexpr double kPriorWeight = 0.25;
  for (size_t c = 0; c < state.offset_frames.size(); ++c) {
    const Eigen::Index first = kClockParams * static_cast<Eigen::Index>(c);
    for (int k = kClockShift; k < kClockParams; ++k) {
      normal.information(first + k, first + k) += kPriorWeight;
      for (auto& gradient : normal.gradients)
        gradient[first + k] += kPriorWeight * state.shift_px[c][k - kClockShift] / kSyncBlocks;
    }
    const bool free = !std::isnan(state.offset_frames[c]) && c != reference_idx;
    if (!free) Hold(first, &normal);
    if (!free || !state.drifts[c]) Hold(first + 1, &normal);
  }
  return normal;
}

/// Scatter of the blocks' gradients (White, "Maximum likelihood estimation of misspecified models", 1982), neighbouring blocks
/// half together (Newey and West, 1987).
Eigen::MatrixXd Scatter(const std::vector<Eigen::VectorXd>& gradients) {
  Eigen::MatrixXd scatter = Eigen::MatrixXd::Zero(gradients[0].size(), gradients[0].size());
  int blocks = 0;
  for (size_t k = 0; k < gradients.size(); ++k) {
    Eigen::VectorXd with_neighbours = gradients[k];
    if (k > 0) with_neighbours += 0.5 * gradients[k - 1];
    if (k + 1 < gradients.size()) with_neighbours += 0.5 * gradients[k + 1];
    scatter += gradients[k] * with_neighbours.transpose();
    blocks += gradients[k].norm() > 0;
  }
  return blocks > 1 ? Eigen::MatrixXd(scatter * blocks / (blocks - 1.0)) : scatter;
}

struct ClockSigma {
  double offset_frames = 0, drift_frames = 0;
};

/// Standard deviations of offsets and drifts: the larger of those from the noise and those from how much blocks of the take
/// disagree; and what the rig's covariance adds.
std::vector<ClockSigma> Sigmas(const PreparedRig& rig, const std::vector<TimedPoint>& points, const State& state,
                               size_t reference_idx) {
  const Normal normal = MakeNormal(points, state, reference_idx);
  const ClockVariances variances = MeasureClockVariances(rig, points, normal.information, normal.held);
  const Eigen::MatrixXd by_blocks = variances.inverse * Scatter(normal.gradients) * variances.inverse;
  const auto sigma = [&](Eigen::Index i) {
    return std::sqrt(std::max(variances.by_noise[i], by_blocks(i, i)) + variances.by_calibration[i]);
  };
  std::vector<ClockSigma> sigmas(state.drifts.size());
  for (size_t c = 0; c < sigmas.size(); ++c) {
    const Eigen::Index first = kClockParams * static_cast<Eigen::Index>(c);
    if (c != reference_idx) sigmas[c] = {sigma(first), state.drifts[c] ? sigma(first + 1) : 0};
  }
  return sigmas;
}

/// One step on all offsets and shifts; returns the largest change of an offset, NaN when the system is singular.
double Step(const Normal& normal, State* state) {
  constexpr double kMaxStepFrames = 1;
  Eigen::VectorXd gradient = Eigen::VectorXd::Zero(normal.information.rows());
  for (const Eigen::VectorXd& each : normal.gradients) gradient += each;
  const Eigen::LDLT<Eigen::MatrixXd> factor(normal.information);
  if (factor.info() != Eigen::Success || !factor.isPositive()) return std::nan("");
  const Eigen::VectorXd step = -factor.solve(gradient);
  if (!step.allFinite()) return std::nan("");
  double largest = 0;
  for (size_t c = 0; c < state->offset_frames.size(); ++c) {
    const Eigen::Index first = kClockParams * static_cast<Eigen::Index>(c);
    const double change = std::clamp(step[first], -kMaxStepFrames, kMaxStepFrames);
    state->offset_frames[c] += change;
    const double drift = std::clamp(step[first + 1], -kMaxStepFrames, kMaxStepFrames);
    state->drift_frames[c] += drift;
    state->shift_px[c] += step.segment<2>(first + kClockShift);
    largest = std::max({largest, std::abs(change), std::abs(drift)});
  }
  return largest;
}

/// Steps until nothing moves; false where there is too little to go by.
bool Converge(const Problem& problem, size_t reference_idx, int num_threads, State* state, std::vector<TimedPoint>* points) {
  constexpr int kMaxSteps = 25;
  constexpr size_t kMinPoints = 30;
  constexpr double kTinyFrames = 1e-5;
  bool ok = false;
  *points = MakePoints(problem, *state, num_threads);
  for (int k = 0; k < kMaxSteps; ++k) {
    if (points->size() < kMinPoints) return false;
    state->scale_px = std::max(MedianResidual(*points) / 1.17741, 1e-6);  // median of |r| of two coordinates
    const double change = Step(MakeNormal(*points, *state, reference_idx), state);
    if (std::isnan(change)) return false;
    *points = MakePoints(problem, *state, num_threads);
    ok = change < 0.01;
    if (change < kTinyFrames) break;
  }
  return ok;
}

/// Cameras whose clocks drift beyond doubt, by so much that it matters, and by no more than clocks do: cameras of nearly one
/// rate differ by 1000 ppm (NTSC) and their crystals' errors. In short takes what the detector does to one posture looks like
/// a drift of percents.
std::vector<bool> Drifting(const State& state, const std::vector<ClockSigma>& sigmas, const Problem& problem) {
  constexpr double kLeastSigmas = 5, kLeastFrames = 0.1, kMostRate = 2e-3;
  std::vector<bool> drifting;
  for (size_t c = 0; c < sigmas.size(); ++c) {
    const double least = std::max(kLeastFrames * problem.repeats, kLeastSigmas * sigmas[c].drift_frames);
    const double drift = std::abs(state.drift_frames[c]);
    drifting.push_back(state.drifts[c] && drift >= least && drift <= kMostRate * problem.half_frames);
  }
  return drifting;
}

/// Lets clocks drift where the motion says that they do. `state` has converged without.
void FindDrifts(const Problem& problem, size_t reference_idx, int num_threads, State* state, std::vector<TimedPoint>* points) {
  State trial = *state;
  std::vector<TimedPoint> trial_points;
  for (size_t c = 0; c < trial.drifts.size(); ++c) trial.drifts[c] = c != reference_idx && !std::isnan(trial.offset_frames[c]);
  if (!Converge(problem, reference_idx, num_threads, &trial, &trial_points)) return;
  const std::vector<bool> all = trial.drifts;
  const std::vector<ClockSigma> sigmas = Sigmas(*problem.rig, trial_points, trial, reference_idx);
  const std::vector<bool> drifting = Drifting(trial, sigmas, problem);
  if (std::none_of(drifting.begin(), drifting.end(), [](bool is) { return is; })) return;
  trial.drifts = drifting;
  for (size_t c = 0; c < drifting.size(); ++c) {
    if (!drifting[c]) trial.drift_frames[c] = 0;
  }
  if (drifting != all && !Converge(problem, reference_idx, num_threads, &trial, &trial_points)) return;
  *state = trial, *points = std::move(trial_points);
}

}  // namespace

FineSync RefineOffsets(const PreparedRig& rig, const std::vector<DetectedFrame>& frames,
                       const std::vector<std::optional<int>>& start_frames, int reference_idx, double repeats,
                       const SyncOptions& options, const RunContext& run) {
  const size_t num_cameras = rig.cameras.size(), reference = static_cast<size_t>(reference_idx);
  std::vector<int> common_frames;
  const Tracks tracks = MakeTracks(rig, frames, start_frames, options.min_score, run, &common_frames);
  FineSync fine;
  State state{{},
              {},
              std::vector<double>(num_cameras, 0),
              std::vector<bool>(num_cameras, false),
              std::vector<Eigen::Vector2d>(num_cameras, Eigen::Vector2d::Zero()),
              0};
  State unmoved = state;
  for (const auto& each : start_frames) {
    state.offset_frames.push_back(each ? *each : std::nan(""));
    state.whole_frames.push_back(each.value_or(0));
    unmoved.whole_frames.push_back(0);
    unmoved.offset_frames.push_back(each ? 0 : std::nan(""));
  }
  fine.offset_frames = state.offset_frames;
  fine.sigma_frames.assign(num_cameras, std::nan(""));
  fine.drift.assign(num_cameras, 0), fine.sigma_drift.assign(num_cameras, 0);
  fine.residual_before_px = fine.residual_after_px = std::nan("");
  const Problem problem = MakeProblem(rig, tracks, common_frames, repeats);
  std::vector<TimedPoint> points;
  fine.ok = Converge(problem, reference, run.num_threads, &state, &points);
  if (!fine.ok) return fine;
  FindDrifts(problem, reference, run.num_threads, &state, &points);
  fine.offset_frames = state.offset_frames;
  fine.middle_frame = problem.middle_frame;
  const std::vector<ClockSigma> sigmas = Sigmas(rig, points, state, reference);
  for (size_t c = 0; c < num_cameras; ++c) {
    fine.sigma_frames[c] = sigmas[c].offset_frames;
    fine.drift[c] = state.drift_frames[c] / problem.half_frames;
    fine.sigma_drift[c] = sigmas[c].drift_frames / problem.half_frames;
  }
  fine.num_points = static_cast<int>(points.size());
  unmoved.shift_px = state.shift_px;
  unmoved.scale_px = state.scale_px;
  CompareResiduals(MakePoints(problem, unmoved, run.num_threads), points, &fine.residual_before_px, &fine.residual_after_px);
  return fine;
}

}  // namespace mvstudio::triangulate::internal
