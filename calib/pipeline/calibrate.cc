#include "calib/calibrate.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <set>
#include <tuple>

#include "calib/bundle/mrcal_engine.h"
#include "calib/bundle/view_clusters.h"
#include "calib/covariance/board_errors.h"
#include "calib/covariance/frame_errors.h"
#include "calib/covariance/omitted_terms.h"
#include "calib/covariance/uncertainty.h"
#include "calib/pipeline/calibrate_steps.h"
#include "calib/pipeline/held_conflict.h"
#include "calib/rig/init.h"
#include "calib/verdict/judgement.h"
#include "core/error.h"
#include "core/format.h"
#include "core/parallel.h"
#include "core/stopwatch.h"

namespace mvstudio::calib {
namespace internal {

void Stop(Status status, const std::string& message, CalibrateReport* report) {
  report->status = status;
  report->message = message;
}

}  // namespace internal

namespace {

using geometry::Rigid3;
using internal::Stop;
using internal::Work;
using internal::World;

void TakeKnownPoses(const CalibrateInput& input, const CalibrateOptions& options, Work* work) {
  const std::vector<bool> fixed = internal::HeldCameras(options.fix, HeldPart::What::kPoses, input.cameras);
  for (size_t c = 0; c < fixed.size(); ++c) {
    const bool placed = input.start && input.start->gauge != kLensesOnly;
    const int index = placed ? input.start->Find(input.cameras[c].name) : -1;
    if (fixed[c] && index < 0)
      throw UsageError("option 'fix' poses: camera " + input.cameras[c].name + " has no pose in the given calibration");
    if (index >= 0) work->known_poses[c] = input.start->cameras[index].cam_from_world;
  }
  work->bundle.fix_camera = fixed;
}

/// Cameras in one frame, the gauge chosen.
bool PlaceCameras(const CalibrateInput& input, const World& world, Work* work, CalibrateReport* report) {
  work->state.frames = work->frames;
  RigInitOptions init;
  init.known_cam_from_world = work->known_poses;
  const RigStart start = InitializeRig(work->views, work->cam_from_board, world.camera, &work->state, init);
  report->components = start.components;
  if (start.status != Status::kOk) {
    Stop(start.status, start.message, report);
    report->suspects = internal::CamerasBesideMost(start.components);
    return false;
  }
  // Boards that no frame links to the first one have no place of their own to be found.
  work->bundle.fix_board.assign(input.boards.size(), false);
  for (const std::vector<int>& group : start.board_components) work->bundle.fix_board[group[0]] = true;
  // Restore the initial weights of all corners on placed boards.
  for (size_t v = 0; v < work->views.size(); ++v) {
    work->placed.push_back((work->views[v].weights.array() > 0).any());
    if (work->placed[v]) work->views[v].weights = work->prior[v];
  }
  work->state.clock_frame = 0.5 * (static_cast<double>(work->frames.front()) + static_cast<double>(work->frames.back()));
  const auto& fixed = work->bundle.fix_camera;
  const bool held = std::find(fixed.begin(), fixed.end(), true) != fixed.end();
  work->bundle.gauge = {held ? Gauge::Kind::kNone : Gauge::Kind::kCamera, world.camera};
  return true;
}

bool Keep(const BundleReport& solved, CalibrateReport* report) {
  report->rms_px = solved.rms_px;
  report->sigma_px = solved.sigma_px;
  report->num_corners = solved.num_corners;
  for (size_t c = 0; c < solved.camera_sigma_px.size(); ++c) report->cameras[c].sigma_px = solved.camera_sigma_px[c];
  if (solved.status == Status::kOk) return true;
  Stop(solved.status, solved.message, report);
  return solved.status == Status::kNotConverged;
}

BundleReport Solve(const CalibrateInput& input, const CalibrateOptions& options, Work* work) {
  if (options.engine != Engine::kMrcal) return SolveBundle(&work->views, &work->state, work->bundle);
  MrcalOptions mrcal;
  mrcal.boards = input.boards;
  mrcal.bundle = work->bundle;
  return SolveWithMrcal(&work->views, &work->state, mrcal);
}

bool Adjust(const CalibrateInput& input, const CalibrateOptions& options, const RunContext& run, Work* work,
            CalibrateReport* report) {
  work->bundle.num_threads = ResolveThreads(run.num_threads);
  if (!Keep(Solve(input, options, work), report)) return false;
  if (const auto separate = internal::SeparateLenses(input, options, work, report); separate && !Keep(*separate, report))
    return false;
  if (input.cameras.size() < 2) return true;
  const internal::TimeModel time = internal::ChooseTimeModel(options, *work, report->sigma_px, &report->time_reason);
  if (!time.offsets) return true;
  Work with = *work;
  const BundleReport solved = internal::SolveWithTimeOffsets(time, &with);
  if (solved.status != Status::kOk && solved.status != Status::kNotConverged) {
    report->time_reason += ", but without a solution: left out";
    return true;
  }
  *work = std::move(with);
  return Keep(solved, report);
}

/// Boards that were held still count for what they are worth.
void DiscountHeldBoards(Work* work, CalibrateReport* report) {
  const size_t cameras = work->state.cameras.size();
  const std::vector<int> of_view = ClusterViews(work->views);
  const std::vector<int> of_frame = ClusterFrames(work->views, of_view, work->state.frames.size());
  const auto correlation = RepeatCorrelation(work->views, of_frame, BundleResiduals(work->views, work->state), cameras);
  work->evidence = DiscountRepeats(work->views, of_frame, correlation);
  std::vector<std::set<int>> places(cameras);
  for (size_t v = 0; v < work->views.size(); ++v) {
    if ((work->views[v].weights.array() > 0).any()) places[work->views[v].camera_idx].insert(of_view[v]);
  }
  for (size_t c = 0; c < cameras; ++c) {
    report->cameras[c].num_places = static_cast<int>(places[c].size());
    report->cameras[c].repeat_correlation = correlation[c];
  }
}

/// The solution as its uncertainty is counted: lenses that were chosen might have the terms that they were spared.
WithOmitted Considered(const CalibrateInput& input, const CalibrateOptions& options, const Work& work, double sigma_px) {
  std::vector<bool> chosen;
  for (size_t c = 0; c < work.state.cameras.size(); ++c)
    chosen.push_back(internal::MaySimplify(input, options, work, static_cast<int>(c)));
  return AddOmittedTerms(work.state, work.bundle, chosen, sigma_px);
}

void StoreCovariance(const RigCovariance& covariance, const HeldCovariance& held, const Work& work, CalibrateReport* report) {
  internal::StoreCalibrationCovariance(covariance, held, work, &report->rig);
  for (size_t c = 0; c < work.state.cameras.size(); ++c)
    report->cameras[c].focal_sigma_px = std::sqrt((covariance.params[c](0, 0) + covariance.params[c](1, 1)) / 2);
}

/// What is stated counts the errors that the corners of one board share. What can be solved does not hang on them: a camera
/// that moved has them, too, and its motion is looked for in the solution.
void CountSharedErrors(const CalibrateInput& input, const CalibrateOptions& options, Work* work, CalibrateReport* report) {
  const std::vector<int> of_view = ClusterViews(work->views);
  const std::vector<double> ratio = VarianceByBoards(work->evidence, of_view, work->state, work->bundle.fix_lens);
  DiscountByBoards(ratio, &work->evidence);
  const WithOmitted considered = Considered(input, options, *work, report->sigma_px);
  double of_rig = 1;
  if (!options.intrinsics_only && ratio.size() > 1) {
    const std::vector<int> of_frame = ClusterFrames(work->views, of_view, work->state.frames.size());
    of_rig = PoseVarianceByFrames(work->evidence, of_frame, considered.state, considered.options, report->sigma_px);
    DiscountByBoards(std::vector<double>(ratio.size(), of_rig), &work->evidence);
  }
  if (of_rig == 1 && std::all_of(ratio.begin(), ratio.end(), [](double one) { return one == 1; })) return;
  const HeldCovariance held = HeldCovarianceOf(input.start, work->state, work->bundle);
  const RigCovariance covariance =
      ComputeCovariance(work->evidence, considered.state, considered.options, report->sigma_px, held);
  if (covariance.status == Status::kOk) StoreCovariance(covariance, held, *work, report);
}

/// `suspects` receives the cameras whose lenses the boards do not determine.
void AddCovariance(const CalibrateInput& input, const CalibrateOptions& options, const Work& work, CalibrateReport* report,
                   std::vector<int>* suspects) {
  const HeldCovariance held = HeldCovarianceOf(input.start, work.state, work.bundle);
  const WithOmitted considered = Considered(input, options, work, report->sigma_px);
  const RigCovariance covariance =
      ComputeCovariance(work.evidence, considered.state, considered.options, report->sigma_px, held);
  if (covariance.status != Status::kOk) {
    *suspects = report->suspects = covariance.undetermined_lenses;
    return Stop(covariance.status, covariance.message, report);
  }
  StoreCovariance(covariance, held, work, report);
  for (size_t c = 0; c < work.state.cameras.size(); ++c) {
    const std::string open = internal::WhyFocalLengthIsOpen(work, report->cameras[c], c);
    if (open.empty()) continue;
    suspects->push_back(static_cast<int>(c)), report->suspects = *suspects;
    Stop(Status::kDegenerate, open, report);
  }
}

/// Triangulated corners against the boards, and what the noise does to projections.
void AddUncertainty(const CalibrateInput& input, const CalibrateOptions& options, const Work& work, CalibrateReport* report) {
  if (!options.intrinsics_only) {
    const std::vector<View>& judged = work.held_out.empty() ? work.views : work.held_out;
    report->board_metrics = ComputeBoardMetrics(input.boards, judged, work.state);
  } else {
    report->board_metrics = ComputeBoardMetrics(input.boards, {}, work.state);
  }
  if (report->status != Status::kOk) return;
  const HeldCovariance held = HeldCovarianceOf(input.start, work.state, work.bundle);
  const WithOmitted considered = Considered(input, options, work, report->sigma_px);
  const ProjectionUncertainty uncertainty(work.evidence, considered.state, considered.options, report->sigma_px, held);
  report->uncertainty = uncertainty.Summarize();
  internal::ReportAspect(input.boards, held, work, report);
  constexpr int kCols = 12, kRows = 8;
  for (size_t c = 0; c < report->uncertainty.cameras.size(); ++c) {
    const double range_m = report->uncertainty.cameras[c].range_m;
    report->uncertainty_maps.push_back(range_m > 0 ? uncertainty.UncertaintyMap(static_cast<int>(c), kCols, kRows, range_m)
                                                   : Eigen::MatrixXd());
  }
}

geometry::RigGauge GaugeOf(const CalibrateInput& input, const CalibrateOptions& options, const World& world, const Work& work) {
  if (options.intrinsics_only) return kLensesOnly;
  if (world.is_board) return geometry::RigGauge::OfBoard(world.frame_idx);
  if (work.bundle.gauge.kind == Gauge::Kind::kNone) return geometry::RigGauge::Other("cameras whose poses were given");
  return geometry::RigGauge::OfCamera(input.cameras[world.camera].name);
}

void AddReadout(const Work& work, CalibrateReport* report) {
  const std::vector<Readout> readouts = EstimateReadout(work.views, work.state, report->sigma_px);
  for (size_t c = 0; c < readouts.size(); ++c) report->cameras[c].readout = readouts[c];
  report->bending = EstimateBending(work.views, work.state, report->sigma_px);
}

/// Cameras placed, everything adjusted, covariance. A status in the report when that fails; `suspects` are then the cameras
/// whose lenses may be the reason.
void Attempt(const CalibrateInput& input, const CalibrateOptions& options, const World& world, const RunContext& run,
             Work* work, CalibrateReport* report, std::vector<int>* suspects) {
  if (options.intrinsics_only) {
    work->state.world_from_board = work->cam_from_board;
  } else {
    if (!PlaceCameras(input, world, work, report)) return;
    if (world.is_board && !internal::UseBoardWorld(input, world, work, report)) return;
  }
  const Stopwatch watch;
  const bool adjusted = Adjust(input, options, run, work, report);
  report->solve_s = watch.Seconds();
  if (!adjusted) {
    *suspects = internal::MostDemanding(*work);
    return;
  }
  internal::FillReport(input, *work, GaugeOf(input, options, world, *work), report);
  internal::ReconsiderFrames(*work, report);
  if (!options.intrinsics_only) AddReadout(*work, report);
  DiscountHeldBoards(work, report);
  const bool converged = report->status == Status::kOk;
  AddCovariance(input, options, *work, report, suspects);
  if (report->status == Status::kOk) CountSharedErrors(input, options, work, report);
  if (!converged && suspects->empty()) *suspects = WeakestLenses(work->evidence, work->state, work->bundle);
  if (!converged && suspects->empty()) *suspects = internal::MostDemanding(*work);
}

/// Tries again with simpler lenses while the boards do not determine those chosen; `work` and `report` hold what the cameras by
/// themselves say, and receive the solution or the first failure.
void SolveRig(const CalibrateInput& input, const CalibrateOptions& options, const World& world, const RunContext& run,
              Work* work, CalibrateReport* report) {
  constexpr int kMaxAttempts = 30;
  std::optional<std::pair<Work, CalibrateReport>> first, shared;  // failure; one lens for several, which is the last resort
  for (int i = 0; i < kMaxAttempts; ++i) {
    std::pair<Work, CalibrateReport> trial(*work, *report);
    std::vector<int> suspects;
    Attempt(input, options, world, run, &trial.first, &trial.second, &suspects);
    if (trial.second.status == Status::kOk) {
      std::tie(*work, *report) = std::move(trial);
      return;
    }
    const std::string why = trial.second.message;
    if (trial.first.separated) {  // the corners contradict one lens for all: lenses of their own, as simple as it takes
      shared.emplace(*work, *report);
      shared->first.may_separate = false;
      internal::GiveLensesOfTheirOwn(work, report);
    }
    if (!first) first = std::move(trial);
    if (i + 1 < kMaxAttempts && internal::SimplifyLenses(input, options, suspects, why, work, report)) continue;
    if (!shared) break;
    std::tie(*work, *report) = std::move(*shared);
    internal::AssumeSharing(why, report);
    shared.reset();
    i = 0;  // one lens for several has its attempts, too
  }
  std::tie(*work, *report) = std::move(*first);
}

/// Returns what the frame numbers of each camera lack, when that is the reason why there is no solution. `seen`: the input,
/// whose views are turned to number the board from one end.
std::vector<int64_t> RunPipeline(const CalibrateOptions& options, const RunContext& run, CalibrateInput* seen,
                                 CalibrateReport* report) {
  const CalibrateInput& input = *seen;
  const World world = internal::FindWorld(options.world, input.cameras);
  Work work;
  internal::MakeWork(input, options, &work);
  ProgressStage stage(run, "calibrating", 3);
  if (!internal::CalibrateLenses(input, options, run, &work, report)) return {};
  stage.Advance(1, "lenses");
  if (options.intrinsics_only) {
    internal::SeparateViews(&work);
  } else {
    const bool frames_agree =
        internal::CheckFrames(options, TurnsOf(input.boards), &work, report);  // in whatever way they are numbered
    internal::TurnNumbering(seen, &work, report);
    report->numbering = FindNumberingFaults(work.views, work.cam_from_board, geometry::CameraNames(work.state.cameras));
    if (!frames_agree) return work.shift;
    TakeKnownPoses(input, options, &work);
    if (!internal::CheckUnitOfHeldPoses(work, report)) return {};
  }
  SolveRig(input, options, world, run, &work, report);
  stage.Advance(1, "adjustment");
  if (report->status == Status::kOk || !report->rig.cameras.empty()) AddUncertainty(input, options, work, report);
  stage.Advance(1, "covariance");
  return {};
}

/// The pipeline; again with boards of their own where rigid ones are in doubt, and kept where that explains the corners. `seen`
/// and the result as of RunPipeline.
std::vector<int64_t> RunWithBoards(CalibrateOptions options, const RunContext& run, CalibrateInput* seen,
                                   CalibrateReport* report) {
  CalibrateInput given = *seen;
  const std::vector<int64_t> shift = RunPipeline(options, run, seen, report);
  if (!shift.empty() || internal::OtherNumbers(*report) || !internal::DoubtfulBoards(given, options, *report)) return shift;
  options.free_boards = AutoOnOff::kOn;
  CalibrateReport trial;
  if (RunPipeline(options, run, &given, &trial).empty() && internal::FreeBoardsPay(*report, &trial)) {
    *report = std::move(trial);
    *seen = std::move(given);
  }
  return shift;
}

/// Why a solution, or that there is none, may be wrong.
void LookForCauses(const CalibrateInput& input, CalibrateOptions options, const RunContext& run, CalibrateReport* report) {
  options.free_boards = report->free_boards ? AutoOnOff::kOn : AutoOnOff::kOff;
  internal::LookForMotions(input, options, run, report);
  report->held_conflict = FindHeldConflict(input, *report, options, run);
}

CalibrateReport CalibrateSorted(const CalibrateInput& input, const CalibrateOptions& options, const RunContext& run);

/// With frames renumbered as was found, where that explains the boards; else as they are numbered.
CalibrateReport CalibrateRenumbered(const CalibrateInput& input, CalibrateOptions options, const RunContext& run,
                                    const CalibrateReport& found) {
  options.seek_numbers = false;
  CalibrateReport again = CalibrateSorted(internal::WithNumbers(input, found), options, run);
  if (internal::DoubtfulNumbers(found, again)) {
    CalibrateReport plain = CalibrateSorted(input, options, run);
    if (!internal::NumbersPay(found, again, plain)) return plain;
  }
  internal::StateNumbers(found, &again);
  return again;
}

CalibrateReport CalibrateSorted(const CalibrateInput& input, const CalibrateOptions& options, const RunContext& run) {
  CalibrateReport report;
  CalibrateInput seen = input;
  const std::vector<int64_t> shift = RunWithBoards(options, run, &seen, &report);
  if (internal::OtherNumbers(report)) return CalibrateRenumbered(input, options, run, report);
  if (shift.empty()) {
    LookForCauses(seen, options, run, &report);
    return report;
  }
  seen = input;
  for (Detection& d : seen.detections) d.frame_idx += shift[d.camera_idx];
  CalibrateReport again;
  RunWithBoards(options, run, &seen, &again);
  LookForCauses(seen, options, run, &again);
  internal::StateShift(shift, report.message, &again);
  return again;
}

}  // namespace

CalibrateReport Calibrate(const CalibrateInput& given, const CalibrateOptions& options, const RunContext& run) {
  if (!(options.need_px >= 0)) throw UsageError("option 'need' " + Format("%g", options.need_px) + ": px must be 0 or more");
  CalibrateInput input = given;
  for (const CameraSplit& split : options.split_at) internal::SplitCamera(split, &input);
  internal::CheckInput(input);
  CalibrateOptions named = options;
  if (named.world.camera.empty()) named.world.camera = input.cameras[0].name;
  CalibrateReport report;
  report.layout = FindLayoutFault(input.boards, input.detections);
  if (report.layout) {
    Stop(Status::kDegenerate, ToString(*report.layout), &report);
    report.cameras.resize(input.cameras.size());
    for (size_t c = 0; c < input.cameras.size(); ++c) report.cameras[c].name = input.cameras[c].name;
    report.verdict = Judge(report);
    return report;
  }
  const std::vector<int> order = internal::ByName(input);
  report = CalibrateSorted(internal::Permuted(input, order), named, run);
  internal::RestoreOrder(order, &report);
  report.need_px = options.need_px;
  if (report.status != Status::kOk) internal::AddLikelyCauses(input, &report);
  report.verdict = Judge(report);
  return report;
}

}  // namespace mvstudio::calib
