#include "stages/pipeline/run.h"

#include <algorithm>
#include <filesystem>
#include <optional>
#include <set>

#include "core/disk/lock.h"
#include "core/format.h"
#include "stages/budget/ask.h"
#include "stages/pipeline/need.h"
#include "stages/pipeline/split_budget.h"

namespace mvstudio::stages {
namespace {

class PipelineRun {
 public:
  PipelineRun(const PipelineOptions& options, const PipelineTools& tools)
      : o_(options), tools_(tools), records_path_(RecordsPath(options.session)) {}

  PipelineReport Run() {
    if (!o_.budget.empty()) end_s_ = BudgetOptions().NowSeconds() + ParseSeconds(o_.budget, "budget");
    const dataset::Session session = dataset::ReadSession(o_.session, o_.allow_outside);
    if (!o_.dry_run && !o_.budget.empty()) PlanBudget();
    std::optional<OutputLock> lock;
    if (!o_.dry_run) lock.emplace(records_path_);
    report_.dry_run = o_.dry_run;
    report_.records = ReadStageRecords(records_path_);
    for (const std::string& warning : session.warnings) report_.warnings.push_back({"SES-FILE", warning, ""});
    report_.stages = PipelineOf(session, o_);
    if (o_.dry_run) PredictNeeds(session, o_, &report_.stages);
    for (const PipelineStage& stage : report_.stages) Visit(stage);
    if (o_.dry_run && !o_.budget.empty()) ReportBudgets();
    if (o_.dry_run) report_.partial = false;
    return std::move(report_);
  }

 private:
  /// What is to be done, as far as it is known before anything is done.
  void PlanBudget() {
    PipelineOptions ahead = o_;
    ahead.dry_run = true;
    PipelineRun plan(ahead, tools_);
    (void)plan.Run();
    planned_ = std::move(plan.planned_);
  }

  void Plan(const PipelineStage& stage, double seconds) {
    planned_.push_back({stage.kind, stage.name(), seconds, HasOwnBudget(stage)});
    for (const LineOption& option : stage.options) {
      if (option.name == "budget" && !option.values.empty()) planned_.back().seconds = ParseSeconds(option.values[0], "budget");
    }
  }

  /// The stage with its part of the time that is left. Its record knows nothing of it: the stage stays up to date.
  PipelineStage WithBudget(PipelineStage stage) {
    const auto at = std::find_if(planned_.begin(), planned_.end(), [&](const auto& time) { return time.name == stage.name(); });
    if (at == planned_.end()) return stage;
    planned_.erase(planned_.begin(), at);
    const double seconds = StageBudget(planned_, end_s_ - BudgetOptions().NowSeconds(), o_.budget);
    if (std::isfinite(seconds)) stage.options.push_back({"budget", {Format("%.3fs", seconds)}});
    return stage;
  }

  void ReportBudgets() {
    const double left_s = ParseSeconds(o_.budget, "budget");
    for (StageRow& row : report_.rows) {
      const auto at = std::find_if(planned_.begin(), planned_.end(), [&](const auto& time) { return time.name == row.stage; });
      if (row.state != RowState::kToDo || at == planned_.end()) continue;
      std::vector<StageTime> first = planned_;
      std::rotate(first.begin(), first.begin() + (at - planned_.begin()), first.end());
      const double seconds = StageBudget(first, left_s, o_.budget);
      if (std::isfinite(seconds)) row.reason += "; its part of the budget: " + SecondsText(seconds);
    }
  }

  void Visit(const PipelineStage& stage) {
    StageRow& row = report_.rows.emplace_back();
    row.stage = stage.name();
    row.command = stage.line().Text();
    if (!IsAskedFor(stage, o_)) {
      row.state = RowState::kNotAsked;
      NoteIfOlder(stage);
    } else if (!stage.left_out.empty()) {
      row.state = RowState::kLeftOut, row.reason = stage.left_out;
    } else if (stopped_ && stage.kind != StageKind::kReport) {
      row.state = RowState::kNotReached;
    } else {
      Decide(stage, &row);
    }
  }

  const StageRecord* Earlier(const PipelineStage& stage) const {
    const auto found = report_.records.find(stage.name());
    return found == report_.records.end() ? nullptr : &found->second;
  }

  /// Errors are in the results alone, which are no inputs.
  bool HasNewResults() const {
    return std::any_of(report_.rows.begin(), report_.rows.end(),
                       [](const StageRow& row) { return row.exit != 0 || row.state == RowState::kDone; });
  }

  void Decide(const PipelineStage& stage, StageRow* row) {
    WarnOfOlder(stage);
    const StageRecord* earlier = Earlier(stage);
    Judgement judged = JudgeStage(stage, tools_.version, earlier, FailuresIn(report_.records));
    row->reason = judged.stale;
    if (judged.now.found) {
      row->state = RowState::kUpToDate, row->found = true;
      if (!o_.dry_run) Keep(stage, &judged.now);
      if (!o_.again) return;
    }
    const std::string after = AfterStage(stage);
    if (!after.empty()) row->reason = "after " + after;
    if (row->reason.empty() && o_.again) row->reason = "asked for";
    if (row->reason.empty() && stage.kind == StageKind::kReport && HasNewResults()) row->reason = "new results";
    row->seconds = SecondsOf(earlier);
    if (row->reason.empty()) {
      row->state = RowState::kUpToDate;
      if (earlier->exit == kExitPartial) row->reason = "some cameras or frames are left out", report_.partial = true;
    } else if (o_.dry_run) {
      row->state = RowState::kToDo, row->need = stage.need, row->found = false;
      Plan(stage, row->seconds);
      to_do_.push_back(&stage);
    } else {
      Do(stage, std::move(judged.now), row);
    }
  }

  /// A stage that is not asked for, and whose result is not what it would make now.
  void NoteIfOlder(const PipelineStage& stage) {
    if (!stage.left_out.empty() || !std::filesystem::exists(stage.output)) return;
    const StageRecord* earlier = Earlier(stage);
    const Judgement judged = JudgeStage(stage, tools_.version, earlier);
    if (!judged.now.found && !judged.stale.empty())
      older_.emplace_back(&stage, earlier ? judged.stale : "older than what it is made of");
  }

  void WarnOfOlder(const PipelineStage& stage) {
    for (const auto& [older, why] : older_) {
      if (stage.kind == StageKind::kReport || !Reads(stage, *older)) continue;
      report_.warnings.push_back({"RUN-OLDER",
                                  stage.name() + " reads what " + older->name() + " writes, and that is not up to date: " + why,
                                  "option 'from' " + std::string(ToString(older->kind)) + " does both"});
    }
  }

  /// A dry run only: the stage to be done whose output this one reads.
  std::string AfterStage(const PipelineStage& stage) const {
    const auto found =
        std::find_if(to_do_.begin(), to_do_.end(), [&](const PipelineStage* earlier) { return Reads(stage, *earlier); });
    return found == to_do_.end() ? "" : (*found)->name();
  }

  void Do(const PipelineStage& stage, StageRecord record, StageRow* row) {
    const StageKeeper keep = [&](const StageRecord* kept) { Keep(stage, kept); };
    const PipelineStage funded = WithBudget(stage);
    row->command = funded.line().Text();
    const StageWords said = DoStage(funded, std::move(record), Earlier(stage), {o_.accept, o_.again}, keep, tools_.call, row);
    report_.partial = report_.partial || row->state == RowState::kPartial;
    for (const Notice& warning : said.warnings) Pass(*row, warning, &report_.warnings);
    for (const Notice& error : said.errors)
      Pass(*row, error, row->state == RowState::kFailed ? &report_.errors : &report_.warnings);
    if (row->state != RowState::kFailed) return;
    if (!stopped_) report_.exit = said.exit;
    stopped_ = true;
  }

  /// Several stages find the same in their input: it is said once.
  void Pass(const StageRow& row, Notice notice, std::vector<Notice>* notices) {
    if (!said_.insert(notice.code + notice.text).second) return;
    notice.text = row.stage + ": " + notice.text;
    notices->push_back(std::move(notice));
  }

  /// nullptr: nothing is known of it.
  void Keep(const PipelineStage& stage, const StageRecord* record) {
    report_.records.erase(stage.name());
    if (record) report_.records[stage.name()] = *record;
    WriteStageRecords(records_path_, report_.records);
  }

  const PipelineOptions& o_;
  const PipelineTools& tools_;
  const std::string records_path_;
  PipelineReport report_;
  std::vector<const PipelineStage*> to_do_;
  std::vector<std::pair<const PipelineStage*, std::string>> older_;  ///< and why
  std::set<std::string> said_;
  std::vector<StageTime> planned_;  ///< with a budget or in a dry run: what is to be done
  double end_s_ = NAN;              ///< of the clock, when the budget is spent
  bool stopped_ = false;
};

}  // namespace

std::string RecordsPath(const std::string& session) { return session + "/run.json"; }

PipelineReport RunPipeline(const PipelineOptions& options, const PipelineTools& tools) {
  return PipelineRun(options, tools).Run();
}

}  // namespace mvstudio::stages
