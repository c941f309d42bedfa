#include "stages/nets/mask/run.h"

#include <algorithm>
#include <filesystem>
#include <utility>

#include "core/disk/files.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "core/stopwatch.h"
#include "dataset/footage/image_io.h"
#include "stages/nets/mask/budget.h"
#include "stages/nets/mask/kept.h"

namespace mvstudio::stages {
namespace {

constexpr int kSheetQuality = 85;  // JPEG; ten times smaller than PNG, and outlines stay sharp to the eye

/// The first of the best: colour alone is cheaper and sharper than a net unless that is better by its figures.
size_t BestTrial(const std::vector<MaskTrial>& trials) {
  constexpr double kClearly = 0.005;
  size_t best = 0;
  for (size_t i = 1; i < trials.size(); ++i) {
    if (trials[i].score() < trials[best].score() - kClearly) best = i;
  }
  return best;
}

/// What the session gives where no option does.
void FillMaskOptions(const TakeInput& take, MaskStageOptions* options, InputNotes* notes) {
  if (options->out.empty()) options->out = take.Folder("masks");
  if (options->out.empty()) throw UsageError("option 'out' is needed without option 'session'");
  const std::string joints = take.Folder("pose3d");
  const bool given = !options->pose3d.empty() || !options->pose2d.empty();
  if (given || joints.empty()) return;
  if (std::filesystem::exists(joints + "/points.csv")) {
    options->pose3d = joints;
    return;
  }
  notes->warnings.push_back({"MSK-NO-JOINTS", joints + ": no 3D joints: plates and movement alone say where people are",
                             "run mvstudio triangulate option 'session' " + options->take.session + " first, then mask again"});
}

/// What the folder of masks must not lie in.
std::vector<std::string> MaskInputs(const TakeInput& take, const MaskStageOptions& options) {
  std::vector<std::string> paths = take.Paths();
  for (const NamedPath& named : options.pose2d) paths.push_back(named.path);
  paths.insert(paths.end(), {options.pose3d, options.calib});
  return paths;
}

/// Trials of an earlier run, where there are several backends.
std::vector<MaskTrial> KeptTrials(const MaskStageOptions& options, const std::string& key) {
  return LoadKept(KeptResults(options.cache, kChoiceOfMasksKind), key, DecodeMaskTrials).value_or(std::vector<MaskTrial>());
}

/// The models of the best trial; those of the others are not kept. `choice`: key of the trials; may be empty.
std::vector<dataset::CameraMaskModel> TryAll(const MaskJob& job, const std::vector<MaskBackend>& backends,
                                             const std::string& choice, const RunContext& run, MaskStageReport* report) {
  const bool several = backends.size() > 1;
  if (several) report->trials = KeptTrials(report->options, choice);
  const bool tried = report->trials.size() == backends.size();
  if (tried) {
    const size_t best = BestTrial(report->trials);
    report->trials[best].models = TryBackend(job, backends[best], false, run).models;
  } else {
    report->trials.clear();
    for (const MaskBackend& backend : backends) report->trials.push_back(TryBackend(job, backend, several, run));
    if (several && !choice.empty()) KeptResults(job.cache, kChoiceOfMasksKind).Store(choice, EncodeMaskTrials(report->trials));
  }
  report->chosen = BestTrial(report->trials);
  MaskTrial& best = report->trials[report->chosen];
  if (!best.failed_camera.empty()) report->outcome = MaskOutcome::kNobody;
  std::vector<dataset::CameraMaskModel> models = std::move(best.models);
  for (MaskTrial& trial : report->trials) trial.models.clear();
  return models;
}

void CheckMaskPart(const MaskStageOptions& options) {
  if (options.out.empty()) throw UsageError("option 'part' needs option 'out', a folder for the list of what is kept");
  if (!KeptResults(options.cache, kMasksKind).enabled())
    throw UsageError("option 'part' keeps its result: give option 'cache'");
}

bool HasCamera(const TakeInput& take, const std::string& camera) {
  return std::any_of(take.footage.begin(), take.footage.end(), [&](const auto& one) { return one.camera == camera; });
}

/// The take as if it had this camera alone.
TakeInput OnlyCamera(const std::string& camera, TakeInput take, MaskStageOptions* options) {
  const auto others = [&](const auto& one) { return one.camera != camera; };
  take.footage.erase(std::remove_if(take.footage.begin(), take.footage.end(), others), take.footage.end());
  const auto named = [&](const NamedPath& one) { return one.name != camera; };
  options->pose2d.erase(std::remove_if(options->pose2d.begin(), options->pose2d.end(), named), options->pose2d.end());
  return take;
}

/// The number of the backend that all cameras' trials choose.
size_t ChosenBackend(const MaskStageOptions& options, const TakeInput& take, const std::vector<MaskBackend>& backends,
                     const RunContext& run, PartReport* part) {
  if (backends.size() < 2) return 0;
  const std::string choice = MaskChoiceKey(options, take, backends);
  const std::vector<MaskTrial> before = KeptTrials(options, choice);
  if (before.size() == backends.size()) return BestTrial(before);
  MaskStageReport report;
  report.options = options;
  TryAll(ReadMaskJob(options, take, &part->notes, run), backends, choice, run, &report);
  if (!choice.empty()) part->kept.push_back(std::string(kChoiceOfMasksKind) + "/" + choice);
  return report.chosen;
}

void KeepMaskFrames(const StagePart& part, MaskStageOptions options, const TakeInput& take, const MaskBackend& backend,
                    const RunContext& run, PartReport* report) {
  const TakeInput alone = OnlyCamera(part.camera, take, &options);
  const MaskJob job = ReadMaskJob(options, alone, &report->notes, run);
  const MaskTrial trial = TryBackend(job, backend, false, run);
  if (!trial.failed_camera.empty()) return;  // the whole says so
  const std::vector<std::string> keys =
      KeepMasks(job, job.cameras[0], backend, trial.models[0], part.first_block, part.end_block, run);
  report->kept.insert(report->kept.end(), keys.begin(), keys.end());
}

/// What is learned already, by the setting that the budget chose.
std::vector<dataset::CameraMaskModel> ChooseWithin(const std::vector<MaskBackend>& backends, const std::string& folder,
                                                   double started_s, double reading_s, const RunContext& run, MaskJob* job,
                                                   MaskBackend* backend, MaskStageReport* report) {
  ChosenMasks chosen = ChooseMasks(backends, report->options, folder, started_s, reading_s, run, job);
  *backend = std::move(chosen.backend);
  if (chosen.learned.failed_camera.empty()) {
    report->budget = std::move(chosen.budget);
  } else {
    report->outcome = MaskOutcome::kNobody;
  }
  std::vector<dataset::CameraMaskModel> models = std::move(chosen.learned.models);
  chosen.learned.models.clear();
  report->trials.push_back(std::move(chosen.learned));
  return models;
}

/// What came of the budget, beside what came of earlier ones in the folder that is replaced.
void KeepMaskBudget(double started_s, const std::string& folder, MaskStageReport* report) {
  BudgetReport& budget = *report->budget;
  const dataset::HullSummary& hull = report->masks.hull;
  budget.actual_error = hull.sums.empty() ? std::nan("") : 100 * hull.Disagreement();
  budget.actual_s = budget.asked.NowSeconds() - started_s;
  const std::string earlier = report->options.out + "/" + kPredictionsFile;
  if (std::filesystem::exists(earlier)) WriteFileAtomic(folder + "/" + kPredictionsFile, ReadFile(earlier));
  KeepPrediction(budget, folder);
}

/// What cannot be must not cost the run.
void CheckBudgetForMasks(const BudgetOptions& budget) {
  (void)budget.BudgetSeconds();
  const std::optional<ErrorTarget> target = budget.Target();
  if (target && target->unit != ErrorUnit::kPercent)
    throw UsageError("option 'target' " + budget.target +
                     ": masks have their disagreement with the visual hull in percent: 12%");
}

/// Sheets, and the scores against exact masks; `folder` is where the masks are now.
void FinishMasks(const std::string& folder, MaskStageReport* report) {
  for (size_t c = 0; c < report->cameras.size(); ++c) {
    const Image& sheet = report->masks.cameras[c].sheet;
    if (!sheet.empty()) dataset::WriteImage(sheet, folder + "/" + report->cameras[c].name + ".sheet.jpg", kSheetQuality);
  }
  for (const auto& [camera, path] : report->options.truth) {
    TruthScore score = CompareWithTruth(path, folder, camera);
    if (!score.worst_image.empty()) score.worst_image = report->options.out + score.worst_image.substr(folder.size());
    report->truth.push_back(std::move(score));
  }
}

}  // namespace

bool MaskStageReport::AllEmpty() const {
  const auto is_empty = [](const MaskCameraResult& r) { return r.take.empty == r.take.images; };
  return std::all_of(masks.cameras.begin(), masks.cameras.end(), is_empty);
}

std::vector<std::string> MaskStageReport::WithoutJoints() const {
  std::vector<std::string> without;
  if (options.pose3d.empty() && options.pose2d.empty()) return without;
  for (size_t c = 0; c < cameras.size(); ++c) {
    if (masks.cameras[c].take.joints == 0) without.push_back(cameras[c].name);
  }
  return without;
}

MaskStageReport RunMask(MaskStageOptions options, const RunContext& run) {
  const Stopwatch watch;
  const double started_s = options.budget.NowSeconds();
  CheckBudgetForMasks(options.budget);
  MaskStageReport report;
  TakeInput take = ReadTakeInput(options.take, &report.notes);
  LeaveOutUncalibrated(options.calib.empty() ? take.calibration : options.calib, &take, &report.notes);
  FillMaskOptions(take, &options, &report.notes);
  report.options = options;
  AtomicFolder folder(options.out, options.run.overwrite, MaskInputs(take, options));
  const std::vector<MaskBackend> backends = MaskBackends(options, &report.notes);
  const double reading_from_s = options.budget.NowSeconds();
  MaskJob job = ReadMaskJob(options, take, &report.notes, run);
  const double reading_s = options.budget.NowSeconds() - reading_from_s;
  for (const MaskCamera& camera : job.cameras) report.cameras.push_back({camera.footage.camera, camera.samples.damage});
  if (!job.poses.empty()) report.pose_frames.emplace(job.poses.begin()->first, job.poses.rbegin()->first);
  const std::string choice = options.budget.Asked() ? "" : MaskChoiceKey(options, take, backends);
  MaskBackend backend;
  const std::vector<dataset::CameraMaskModel> models =
      options.budget.Asked() ? ChooseWithin(backends, folder.work_path(), started_s, reading_s, run, &job, &backend, &report)
                             : TryAll(job, backends, choice, run, &report);
  if (report.outcome == MaskOutcome::kNobody) return report;
  if (!report.budget) backend = backends[report.chosen];
  report.masks = MakeMasks(job, backend, models, folder.work_path(), run);
  FinishMasks(folder.work_path(), &report);
  if (report.budget) KeepMaskBudget(started_s, folder.work_path(), &report);
  folder.Commit();
  if (report.budget) ForgetMasks(job, {backend}, "");
  ForgetMasks(job, backends, choice);
  report.wall_s = watch.Seconds();
  return report;
}

PartReport RunMaskPart(MaskStageOptions options, const RunContext& run) {
  const StagePart part = ParsePart(options.part);
  CheckMaskPart(options);
  if (part.kind == PartKind::kShare)
    throw UsageError("option 'part' " + options.part + ": masks are made by samples=CAMERA, choice and frames=CAMERA");
  PartReport report{{}, options.part, options.out, {}};
  TakeInput take = ReadTakeInput(options.take, &report.notes);
  if (part.kind != PartKind::kChoice && !HasCamera(take, part.camera))
    throw UsageError("option 'part': the take has no footage of camera " + part.camera);
  LeaveOutUncalibrated(options.calib.empty() ? take.calibration : options.calib, &take, &report.notes);
  FillMaskOptions(take, &options, &report.notes);
  AtomicFolder folder(options.out, options.run.overwrite, MaskInputs(take, options));
  const bool left_out = part.kind != PartKind::kChoice && !HasCamera(take, part.camera);
  if (left_out) {
    report.notes.partial = true;
  } else if (part.kind == PartKind::kSamples) {
    const MaskJob job = ReadMaskJob(options, OnlyCamera(part.camera, take, &options), &report.notes, run);
    report.kept.push_back(std::string(kSamplesKind) + "/" + job.cameras[0].samples_key);
  } else {
    const std::vector<MaskBackend> backends = MaskBackends(options, &report.notes);
    const size_t chosen = ChosenBackend(options, take, backends, run, &report);
    if (part.kind == PartKind::kFrames) KeepMaskFrames(part, options, take, backends[chosen], run, &report);
  }
  WritePart(report, folder.work_path());
  folder.Commit();
  return report;
}

}  // namespace mvstudio::stages
