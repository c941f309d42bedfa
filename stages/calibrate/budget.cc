#include "stages/calibrate/budget.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "calib/lens/lens_limits.h"
#include "calib/pipeline/solvable.h"
#include "core/disk/output.h"
#include "core/disk/trace.h"
#include "core/error.h"
#include "core/format.h"
#include "core/parallel.h"
#include "core/quiet_run.h"
#include "stages/calib/board_views.h"
#include "stages/calib/film_gain.h"
#include "stages/input/board_footage.h"

namespace mvstudio::stages {
namespace {

constexpr double kFewestImages = 8;  // of a camera: fewer boards give no lens worth a name

/// Boards on which settings are tried. Sizes count images a camera, or the time steps of a file of corners.
struct TrialBoards {
  CalibrateReport report;  ///< with the options as prepared
  CornerInput corners;
  int every = 1;                 ///< of which the corners are
  double searched = 0, all = 0;  ///< images
  std::vector<WorkPart> fixed;   ///< what it takes to find them, however they are solved
};

/// One way to solve, at growing parts of the trial's boards.
struct LensTrial {
  std::optional<geometry::LensModel> model;  ///< none: the lens is chosen
  WorkPart solving{"solving"};
  std::vector<SizedError> errors;                ///< held-out, px
  double uncertainty = 0, uncertainty_size = 0;  ///< UncertaintyOf of the largest part
  std::string found;                             ///< the lens that all cameras have at all sizes; empty: there is none
  std::string message;                           ///< why there is no solution
};

struct BoardSetting {
  int every = 1;  ///< times what was given
  std::optional<geometry::LensModel> model;
};

/// Error on boards that took no part, px, as the command prints it.
double JudgedCalibration(const calib::CalibrateReport& solved) {
  return solved.status == Status::kOk ? solved.holdout_rms_px : std::nan("");
}

/// Uncertainty of projections at the image's sides over what the verdict accepts; of the worst camera, 0 where none states one.
double UncertaintyOf(const calib::CalibrateReport& solved) {
  double worst = 0;
  for (const calib::CameraUncertainty& camera : solved.uncertainty.cameras) {
    const int idx = solved.rig.Find(camera.name);
    if (idx < 0 || !std::isfinite(camera.edge_px)) continue;
    const geometry::Camera& lens = solved.rig.cameras[static_cast<size_t>(idx)].camera;
    worst = std::max(worst, camera.edge_px / calib::PixelLimitsOf(lens, solved.need_px).side_px);
  }
  return worst;
}

/// Steps of twice the images from the whole to what a trial takes: a quarter, 12 to 40 images.
int TrialEvery(double all) {
  constexpr double kFewest = 12, kMost = 40;
  const double wanted = std::clamp(all / 4, kFewest, kMost);
  int every = 1;
  while (all / every > std::sqrt(2.0) * wanted) every *= 2;
  return every;
}

double LongestFootage(const CornerArguments& corners) {
  constexpr double kUnknown = 300;
  InputNotes ignored;
  int64_t longest = 0;
  for (const calib::Footage& footage : OpenFootage(corners.cameras, &ignored)) longest = std::max(longest, footage.num_frames);
  return longest > 0 ? static_cast<double>(longest) : kUnknown;
}

/// Reading all footage takes the same for every setting, searching grows with the images that are searched.
void TimeSearch(double seconds, TrialBoards* boards) {
  double read_s = 0, search_s = 0, num_read = 0, num_searched = 0, cameras = 0;
  for (const calib::FootageDetections& camera : boards->corners.found) {
    read_s += camera.read_s, search_s += camera.search_s, ++cameras;
    num_read += static_cast<double>(camera.num_read), num_searched += camera.num_images;
  }
  const double share = search_s / std::max(read_s + search_s, 1e-9);
  boards->searched = std::max(num_searched / cameras, 1.0);
  boards->all = std::max(num_read / cameras / boards->report.options.corners.footage.every, boards->searched);
  boards->fixed.push_back({"reading", 1, {{1, (1 - share) * seconds}}});
  boards->fixed.push_back({"search", boards->all, {{boards->searched, share * seconds}}});
}

void SearchPart(const CalibrateOptions& options, const RunContext& run, TrialBoards* boards) {
  CornerArguments corners = options.corners;
  boards->every = TrialEvery(LongestFootage(corners) / corners.footage.every);
  corners.footage.every *= boards->every, corners.footage.max_frames = 0;
  corners.footage.cache.kind = CachePlace::Kind::kOff;
  const double begin_s = options.budget.NowSeconds();
  boards->corners = ReadCornerInput(corners, run, &boards->report.notes);
  TimeSearch(options.budget.NowSeconds() - begin_s, boards);
}

std::vector<int64_t> StepsOfBoards(const calib::CalibrateInput& input) {
  std::set<int64_t> steps;
  for (const calib::Detection& detection : input.detections) steps.insert(detection.frame_idx);
  return {steps.begin(), steps.end()};
}

/// Boards of every `every`th time step that shows one.
calib::CalibrateInput EveryNth(const calib::CalibrateInput& input, int every) {
  const std::vector<int64_t> steps = StepsOfBoards(input);
  std::set<int64_t> kept;
  for (size_t i = 0; i < steps.size(); i += static_cast<size_t>(every)) kept.insert(steps[i]);
  calib::CalibrateInput part = input;
  const auto dropped = [&](const calib::Detection& detection) { return kept.count(detection.frame_idx) == 0; };
  part.detections.erase(std::remove_if(part.detections.begin(), part.detections.end(), dropped), part.detections.end());
  return part;
}

void ReadPart(const CalibrateOptions& options, const RunContext& run, TrialBoards* boards) {
  boards->corners = ReadCornerInput(options.corners, run, &boards->report.notes);
  boards->all = static_cast<double>(StepsOfBoards(boards->corners.input).size());
  boards->every = TrialEvery(boards->all);
  boards->corners.input = EveryNth(boards->corners.input, boards->every);
  boards->searched = static_cast<double>(StepsOfBoards(boards->corners.input).size());
}

TrialBoards BoardsForTrial(const CalibrateReport& report, const PrepareCorners& prepare, const RunContext& run) {
  TrialBoards boards;
  boards.report.options = report.options;
  boards.report.options.solve.world = {};  // its board may not be among these
  if (report.options.corners.corners.empty()) {
    SearchPart(report.options, run, &boards);
  } else {
    ReadPart(report.options, run, &boards);
  }
  prepare(&boards.report, &boards.corners);
  return boards;
}

/// The lens model that all cameras have; empty where they differ.
std::string CommonLens(const calib::CalibrateReport& solved) {
  std::set<geometry::LensModel> models;
  for (const calib::CameraReport& camera : solved.cameras) models.insert(camera.model);
  const bool one = models.size() == 1 && *models.begin() != geometry::LensModel::kSplined;
  return one ? std::string(ToString(*models.begin())) : "";
}

/// Solves growing parts; stops where `enough` says so after one. The images of the report are written once, and timed.
void TryLens(TrialBoards* boards, const RunContext& run, const std::function<bool()>& enough, LensTrial* trial) {
  const CalibrateOptions& options = boards->report.options;
  calib::CalibrateOptions solve = options.solve;
  if (trial->model) solve.model = trial->model;
  for (const int every : {4, 2, 1}) {
    const calib::CalibrateInput part = EveryNth(boards->corners.input, every);
    const double size = boards->searched / every;
    if (size < kFewestImages / 2 || (!trial->solving.timings.empty() && enough())) continue;
    const double begin_s = options.budget.NowSeconds();
    const calib::SolvableCalibration solved = calib::CalibrateSolvable(part, solve, run);
    if (solved.report.status != Status::kOk) {
      trial->message = solved.report.message;
      continue;
    }
    (void)PredictGain(solved.report, part.boards);
    trial->solving.timings.push_back({size, options.budget.NowSeconds() - begin_s});
    trial->errors.push_back({size, JudgedCalibration(solved.report)});
    if (trial->errors.size() > 2) trial->errors.erase(trial->errors.begin());  // of few boards, it is erratic
    trial->uncertainty = UncertaintyOf(solved.report), trial->uncertainty_size = size;
    const std::string found = CommonLens(solved.report);
    trial->found = trial->solving.timings.size() == 1 || trial->found == found ? found : "";
    if (every > 1 || boards->corners.found.empty() || trial->model) continue;
    const AtomicFolder scratch(options.out + "/budget-trial", false);
    const double write_s = options.budget.NowSeconds();
    (void)WriteBoardViews(options.corners, solved.report, solved.kept, scratch.work_path(), run);
    boards->fixed.push_back({"images of the report", 1, {{1, options.budget.NowSeconds() - write_s}}});
  }
}

/// Whether `every` may thin the footage further: not beside a number of images that was given.
bool MayThin(const CalibrateOptions& options) {
  const calib::FootageOptions& footage = options.corners.footage;
  return options.corners.corners.empty() && footage.every == 1 && footage.max_frames == 0 &&
         options.given.count("every") == 0 && options.given.count("max-frames") == 0;
}

bool MayChooseLens(const CalibrateOptions& options) {
  return !options.solve.model && options.start.empty() && options.lenses.empty() && options.given.count("model") == 0;
}

/// A board that defines the world must be searched.
bool KeepsWorld(const CalibrateOptions& options, int every) {
  const auto& frame = options.solve.world.board_frame;
  return !frame || *frame % every == 0;
}

/// Images a camera that are searched.
double SearchedBy(const CalibrateOptions& options, const TrialBoards& boards, int every) {
  if (every > 1) return std::min(boards.searched * boards.every / every, boards.all);
  const double most = options.corners.footage.max_frames;
  return most > 0 ? boards.all / std::ceil(boards.all / most) : boards.all;
}

std::string ImagesText(const CalibrateOptions& options, double size, double all) {
  const bool file = !options.corners.corners.empty();
  return Format("%.0f of %.0f ", size, all) + (file ? "time steps of the file" : "images a camera");
}

SettingTrial TrialOf(const CalibrateOptions& options, const TrialBoards& boards, const LensTrial& chosen_lens,
                     const LensTrial& lens, int every) {
  SettingTrial trial;
  if (every > 1) trial.flags.emplace_back("every", std::to_string(every));
  if (lens.model) trial.flags.emplace_back("model", std::string(ToString(*lens.model)));
  trial.size = SearchedBy(options, boards, every);
  trial.what = ImagesText(options, trial.size, boards.all);
  if (lens.solving.timings.empty()) {
    trial.why_not = "a fifth of the budget had gone into solving parts";
    return trial;
  }
  trial.parts = boards.fixed;
  trial.parts.push_back(lens.solving);
  const Foretold error = ForetellError(chosen_lens.errors, trial.size);
  trial.error = error.value, trial.error_sigma = error.sigma;
  trial.uncertainty = chosen_lens.uncertainty * std::sqrt(chosen_lens.uncertainty_size / trial.size);
  if (trial.uncertainty > 1)
    trial.short_of = Format("projections at the image's sides would be uncertain by %.2g times what option 'need' allows",
                            trial.uncertainty);
  return trial;
}

/// The settings from the cheapest to the dearest, with their trials in the budget.
std::vector<BoardSetting> AddSettings(const TrialBoards& boards, const std::vector<LensTrial>& lenses,
                                      const CalibrateReport& report, BudgetReport* budget) {
  std::vector<BoardSetting> settings;
  int most = 1;
  // Below the parts whose error was judged, the lens may become another one, and nothing is known of the error.
  const double fewest = std::max<double>(kFewestImages, std::floor(lenses[0].errors.front().size));
  while (MayThin(report.options) && SearchedBy(report.options, boards, 2 * most) >= fewest) most *= 2;
  for (int every = most; every >= 1; every /= 2) {
    if (!KeepsWorld(report.options, every)) continue;
    for (auto lens = lenses.rbegin(); lens != lenses.rend(); ++lens) {
      settings.push_back({every, lens->model});
      budget->trials.push_back(TrialOf(report.options, boards, lenses[0], *lens, every));
    }
  }
  return settings;
}

/// The lens left open, and where that finds one and the same at all sizes, this one given.
std::vector<LensTrial> TryLenses(TrialBoards* boards, const CalibrateOptions& options, const RunContext& run,
                                 const std::function<bool()>& enough) {
  std::vector<LensTrial> lenses(1);
  TryLens(boards, run, enough, &lenses[0]);
  if (lenses[0].solving.timings.empty()) {
    throw UsageError(Format("option 'budget' or option 'target': the trial on %.0f images a camera gives no calibration (",
                            boards->searched) +
                     lenses[0].message + "); leave it out, or film more boards");
  }
  if (!MayChooseLens(options) || lenses[0].found.empty() || lenses[0].solving.timings.size() < 2) return lenses;
  LensTrial& given = lenses.emplace_back();
  FromString(lenses[0].found, "model", &given.model);
  if (!enough()) TryLens(boards, run, enough, &given);
  return lenses;
}

const SettingTrial* FindSetting(const std::vector<BoardSetting>& settings, const BudgetReport& budget,
                                const BoardSetting& wanted) {
  for (size_t i = 0; i < settings.size(); ++i) {
    if (settings[i].every == wanted.every && settings[i].model == wanted.model) return &budget.trials[i];
  }
  return nullptr;
}

std::string OutcomeText(const BudgetReport& budget, const SettingTrial& trial) {
  if (!trial.IsTried()) return "was not tried: " + trial.why_not;
  const std::string seconds = "would take " + SecondsText(trial.predicted_s);
  if (!std::isfinite(trial.error)) return seconds;
  return seconds + Format(" and leave %.3g ", trial.error) + std::string(ToString(budget.unit));
}

std::string ReasonForImages(const std::vector<BoardSetting>& settings, const BudgetReport& budget, const BoardSetting& chosen) {
  std::string reason = "option 'every': " + budget.Chosen().what + " are searched";
  for (const int every : {chosen.every / 2, 2 * chosen.every}) {
    const SettingTrial* other = FindSetting(settings, budget, {every, chosen.model});
    if (other) reason += "; " + other->what + " " + OutcomeText(budget, *other);
  }
  return reason;
}

std::string ReasonForLens(const std::vector<BoardSetting>& settings, const BudgetReport& budget, const BoardSetting& chosen,
                          const std::vector<LensTrial>& lenses) {
  const bool two = lenses.size() > 1;
  std::string reason = "option 'model': the lens is chosen on all these boards";
  if (chosen.model)
    reason = "option 'model': " + lenses[0].found + ", which parts of the boards chose alike; choosing it anew ";
  if (!two) return reason + (lenses[0].found.empty() ? "; parts of them choose differently" : "");
  if (!chosen.model) reason += "; " + lenses[0].found + ", which parts of them chose alike, ";
  const SettingTrial* other = FindSetting(settings, budget, {chosen.every, chosen.model ? std::nullopt : lenses[1].model});
  return reason + OutcomeText(budget, *other);
}

/// A sentence for each setting: what was taken, and what the next one would be.
std::vector<std::string> ReasonsForBoards(const std::vector<BoardSetting>& settings, const BudgetReport& budget,
                                          const std::vector<LensTrial>& lenses, const CalibrateOptions& options) {
  const BoardSetting& chosen = settings[static_cast<size_t>(budget.choice.index)];
  std::vector<std::string> reasons;
  if (MayThin(options)) reasons.push_back(ReasonForImages(settings, budget, chosen));
  if (MayChooseLens(options)) reasons.push_back(ReasonForLens(settings, budget, chosen, lenses));
  return reasons;
}

}  // namespace

void ChooseCalibration(double started_s, const PrepareCorners& prepare, const RunContext& run, CalibrateReport* report) {
  constexpr double kTrialShare = 0.2;  // of the budget, for solving
  BudgetReport& budget = report->budget.emplace();
  budget.stage = "calibrate", budget.asked = report->options.budget;
  budget.less_work = "fewer images (option 'every')";
  budget.better_data = "more boards, tilted and out to the image's corners,";
  budget.threads = ResolveThreads(run.num_threads);
  const double begin_s = budget.asked.NowSeconds();
  const UntracedScope untraced;
  const QuietRun quiet(run);
  ProgressStage stage(run, "trial for the budget", 2);
  TrialBoards boards = BoardsForTrial(*report, prepare, quiet.context());
  budget.sizes = {{"frames", boards.all}, {"cameras", static_cast<double>(boards.corners.input.cameras.size())}};
  stage.Advance();
  const double most_s = budget.asked.NowSeconds() + kTrialShare * budget.asked.BudgetSeconds();
  const auto enough = [&] { return budget.asked.NowSeconds() > most_s; };
  const std::vector<LensTrial> lenses = TryLenses(&boards, report->options, quiet.context(), enough);
  const std::vector<BoardSetting> settings = AddSettings(boards, lenses, *report, &budget);
  stage.Advance();
  budget.trial_s = budget.asked.NowSeconds() - begin_s;
  Choose(budget.asked.NowSeconds() - started_s, &budget);
  budget.reasons = ReasonsForBoards(settings, budget, lenses, report->options);
  const BoardSetting& chosen = settings[static_cast<size_t>(budget.choice.index)];
  report->options.corners.footage.every *= chosen.every;
  if (chosen.model) report->options.solve.model = chosen.model;
}

void KeepCalibrationOutcome(double started_s, CalibrateReport* report) {
  BudgetReport& budget = *report->budget;
  const auto* found = std::get_if<BoardCalibration>(&report->found);
  if (found && !report->path.empty()) budget.actual_error = JudgedCalibration(found->solved.report);
  budget.actual_s = budget.asked.NowSeconds() - started_s;
  if (!report->path.empty()) KeepPrediction(budget, report->options.out);
}

}  // namespace mvstudio::stages
