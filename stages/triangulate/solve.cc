#include "stages/triangulate/solve.h"

#include <algorithm>

#include "dataset/pose/pose3d.h"
#include "stages/input/take_frames.h"
#include "triangulate/take/blocks.h"
#include "triangulate/take/steps.h"
#include "triangulate/take/stream.h"

namespace mvstudio::stages {
namespace {

bool Filters(const TriangulateOptions& options) { return options.markers.filter != "none" || options.markers.fill_frames > 0; }

/// What is done with the take once its single points are there: joints of each person together where that predicts left-out
/// cameras better, and what such cameras say of the filter.
void RefineTake(const PoseInput& input, const RunContext& run, TriangulateReport* report) {
  const TriangulateOptions& given = report->options;
  triangulate::TakeResult& take = report->take;
  if (!(given.refine || Filters(given)) || take.method.IsExhaustiveDlt()) return;
  triangulate::TakeOptions options = given.points;
  options.select_views |= options.method.IsAuto();
  triangulate::TakeProblem problem;
  problem.rig = triangulate::Prepare(input.rig, options.ignore_distortion);
  const triangulate::PointSolver solve = SolverFor(input.rig, problem, options, take.method);
  if (Filters(given)) report->filter = CheckFilter(problem.rig, take, solve, input.skeleton, given.markers, run);
  if (!given.refine) return;
  report->refined_without_bones = input.skeleton.bones.empty();
  triangulate::SkeletonRefineResult refined =
      RefineSkeleton(problem.rig, take, input.skeleton.bones, solve, given.refinement, run);
  take.points = std::move(refined.points);
  report->refinement = std::move(refined.report);
}

/// `pose` with what its file says beside the points.
dataset::Pose3d WithHead(dataset::Pose3d pose, const TriangulateReport& report) {
  const auto& text = report.options.file_text;
  const std::string why = report.WhyWithoutCovariance();
  pose.covariance_note = CovarianceUse(report.rig, report.cameras, text ? text(why) : why);
  pose.world = WorldText(report.rig);
  pose.frame_rate_hz = report.options.markers.rate_hz;
  return pose;
}

bool HasError(const TriangulateReport& report) {
  return report.loss.kind != Loss::Kind::kNone || report.limbs.WrongSkeleton() || report.NothingInCommon() ||
         report.inconsistency != Inconsistency::kNone;
}

/// When the take is lost or does not fit: why. Else whether its cameras are synchronous.
CauseQuestion QuestionOf(const TriangulateReport& report) {
  const bool lost = report.loss.kind != Loss::Kind::kNone;
  if (lost && report.loss.reason != Loss::Reason::kUnknown) return CauseQuestion::kNone;
  if (lost || report.inconsistency != Inconsistency::kNone) return CauseQuestion::kLoss;
  if (report.limbs.WrongSkeleton()) return CauseQuestion::kNone;  // a cause already
  const auto& cameras = report.take.cameras;
  const bool apart = std::any_of(cameras.begin(), cameras.end(), [](const triangulate::CameraDiagnosis& camera) {
    return 2 * camera.num_rejected > camera.num_detections;
  });
  if (apart) return CauseQuestion::kCamera;
  // More than good detectors scatter with a calibrated rig; a bumped camera, or mirrored images of people in their middle, may
  // show little more.
  constexpr double kScatterOfDiagonal = 0.003;
  return report.take.sigma_px > kScatterOfDiagonal * report.MeanDiagonalPx() ? CauseQuestion::kScatter : CauseQuestion::kTiming;
}

}  // namespace

Inconsistency InconsistencyOf(const triangulate::TakeResult& take, double diagonal_px) {
  constexpr double kMaxSigmaOfDiagonal = 0.015, kMaxLeftOutOfDiagonal = 0.03, kSearchEnds = 0.25;
  const triangulate::LeftOutFigures& left_out = take.holdout.all;
  if (take.sigma_px > kSearchEnds * diagonal_px) return Inconsistency::kNoNoiseExplains;
  if (take.sigma_px > kMaxSigmaOfDiagonal * diagonal_px) return Inconsistency::kNoise;
  if (left_out.num_samples > 0 && left_out.coverage < 0.5) return Inconsistency::kRarelyPredicted;
  const bool far = left_out.num_samples > 0 && left_out.median_px > kMaxLeftOutOfDiagonal * diagonal_px;
  return far ? Inconsistency::kFarFromPrediction : Inconsistency::kNone;
}

geometry::Rig SolvedRig(const TriangulateReport& report) {
  geometry::Rig rig = report.rig;
  if (!report.options.points.ignore_distortion) return rig;
  for (geometry::RigCamera& camera : rig.cameras) camera.camera = PinholeOf(camera.camera), camera.params_covariance.reset();
  return rig;
}

std::vector<triangulate::DetectedFrame> SampleOf(const PoseParts& parts, size_t chunk) {
  constexpr size_t kRuns = 8;
  const size_t length = (chunk + kRuns - 1) / kRuns, count = parts.num_frames();
  InputNotes ignored;  // skipped files are listed when their chunk is read
  if (chunk >= count) return parts.Read(0, count, &ignored);
  std::vector<triangulate::DetectedFrame> sample;
  for (size_t run = 0, next = 0; run < kRuns && next < count; ++run) {
    const size_t begin = std::max(next, run * count / kRuns);
    next = begin + length;
    for (triangulate::DetectedFrame& frame : parts.Read(begin, next, &ignored)) sample.push_back(std::move(frame));
  }
  return sample;
}

void SolveWhole(const PoseInput& input, const RunContext& run, PointStatistics* statistics, TriangulateReport* report) {
  constexpr size_t kKeptFrames = 250;
  const TriangulateOptions& options = report->options;
  statistics->AddFrames(input.frames, options.points);
  if (!options.refine && !Filters(options) && !report->project) {
    triangulate::TakeBlocks blocks(input.rig, input.frames, BodyOf(input.skeleton), options.points, run, kKeptFrames);
    const auto next = [&](std::vector<dataset::JointRow>* rows) {
      triangulate::TakeResult block;
      if (!blocks.Next(&block)) return false;
      statistics->Add(block);
      *rows = ToPose3d(block, input.skeleton).rows;
      if (report->beginning.points.empty()) report->beginning = std::move(block);
      return true;
    };
    report->take.method = options.points.method;
    dataset::WritePose3d(WithHead(ToPose3d({}, input.skeleton), *report), next, options.out);
    report->take = blocks.Finish();
    return;
  }
  report->take = triangulate::TriangulateTake(input.rig, input.frames, BodyOf(input.skeleton), options.points, run);
  RefineTake(input, run, report);
  statistics->Add(report->take);
  dataset::Pose3d pose = WithHead(ToPose3d(report->take, input.skeleton), *report);
  if (report->project) WriteProjectParts(input.rig, options.project, options.out, &pose, &*report->project);
  dataset::WritePose3d(pose, options.out);
}

void SolveChunks(const PoseParts& parts, const RunContext& run, PointStatistics* statistics, TriangulateReport* report) {
  const PoseInput& input = parts.input();
  const TriangulateOptions& options = report->options;
  const triangulate::TakeBody body = BodyOf(input.skeleton);
  const size_t chunk = static_cast<size_t>(options.chunk_frames);
  triangulate::TakeStream stream(input.rig, body,
                                 SettleOptions(input.rig, SampleOf(parts, chunk), body, options.points, run, &report->take));
  size_t begin = 0;
  const auto next = [&](std::vector<dataset::JointRow>* rows) {
    if (begin >= parts.num_frames()) return false;
    const auto frames = parts.Read(begin, begin + chunk, &report->notes);
    const triangulate::TakeResult part = stream.Push(frames, run);
    statistics->Add(part);
    statistics->AddFrames(frames, options.points);
    *rows = ToPose3d(part, input.skeleton).rows;
    begin += chunk;
    return true;
  };
  dataset::WritePose3d(WithHead(ToPose3d({}, input.skeleton), *report), next, options.out);
}

void JudgeTake(const PoseInput& input, const PointStatistics& statistics, const SampleFrames& sample, const RunContext& run,
               TriangulateReport* report) {
  report->points = statistics.Figures(input.rig, input.cameras, input.skeleton);
  if (statistics.num_ok() > 0) report->comparisons = CompareWithReferences(report->options);
  report->limbs = JudgeLimbs(report->take, input);
  report->trunk_tilt_deg = TrunkTiltDeg(report->take.points, input.skeleton);
  report->loss = statistics.LossOf(report->options.points);
  if (!HasError(*report)) report->inconsistency = InconsistencyOf(report->take, report->MeanDiagonalPx());
  report->asked = QuestionOf(*report);
  if (report->asked == CauseQuestion::kNone) return;
  triangulate::CauseOptions options;
  options.min_score = report->options.points.min_score, options.max_persons = report->options.points.max_persons;
  options.alike = report->asked == CauseQuestion::kScatter;
  const geometry::Rig rig = SolvedRig(*report);
  report->causes = report->asked == CauseQuestion::kTiming ? CheckTiming(rig, sample(), options, run)
                                                           : RankCauses(rig, sample(), BodyOf(input.skeleton), options, run);
}

}  // namespace mvstudio::stages
