#include <algorithm>
#include <filesystem>
#include <optional>
#include <set>

#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "cli/stage_run.h"
#include "core/disk/lock.h"
#include "core/format.h"
#include "core/join.h"
#include "stages/pipeline/need.h"
#include "stages/report_fields.h"

namespace mvstudio::cli {
namespace {

using stages::StageRecords;

/// The stages of a session one after the other, as far as they have to be done.
class Pipeline {
 public:
  Pipeline(const stages::PipelineOptions& options, CommandContext& context)
      : o_(options), context_(context), records_path_(options.session + "/run.json") {}

  CommandResult Run() {
    const dataset::Session session = dataset::ReadSession(o_.session, o_.allow_outside);
    std::optional<OutputLock> lock;
    if (!o_.dry_run) lock.emplace(records_path_);
    records_ = stages::ReadStageRecords(records_path_);
    for (const std::string& warning : session.warnings) result_.warnings.push_back({"SES-FILE", warning, ""});
    stages_ = stages::PipelineOf(session, o_);
    if (o_.dry_run) stages::PredictNeeds(session, o_, &stages_);
    for (const PipelineStage& stage : stages_) Visit(stage);
    Summarise();
    return std::move(result_);
  }

 private:
  void Visit(const PipelineStage& stage) {
    StageRow& row = rows_.emplace_back();
    row.stage = stage.name();
    row.command = "mvstudio " + Join(stage.Words("--"), " ");
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
    const auto found = records_.find(stage.name());
    return found == records_.end() ? nullptr : &found->second;
  }

  /// Errors are in the results alone, which are no inputs.
  bool HasNewResults() const {
    return std::any_of(rows_.begin(), rows_.end(),
                       [](const StageRow& row) { return row.exit != 0 || row.state == RowState::kDone; });
  }

  void Decide(const PipelineStage& stage, StageRow* row) {
    WarnOfOlder(stage);
    const StageRecord* earlier = Earlier(stage);
    StageRecord now = stages::RecordOf(stage, MVSTUDIO_VERSION, earlier);
    if (stage.kind == StageKind::kReport) now.told = stages::FailuresIn(records_);
    row->reason = stages::WhyStale(stage, now, earlier);
    // A report that others made need not tell of failures: they are in run.json, which is none of its inputs.
    if (!row->reason.empty() && !earlier && now.told.empty() && stages::IsNewerThanInputs(stage)) {
      now.found = true;
      row->reason = "found, newer than what it is made of";
      row->state = RowState::kUpToDate;
      if (!o_.dry_run) Keep(stage, &now);
      if (!o_.again) return;
    }
    const std::string after = AfterStage(stage);
    if (!after.empty()) row->reason = "after " + after;
    if (row->reason.empty() && o_.again) row->reason = "asked for";
    if (row->reason.empty() && stage.kind == StageKind::kReport && HasNewResults()) row->reason = "new results";
    row->seconds = earlier && !earlier->found && earlier->exit != stages::kBegun ? earlier->seconds : NAN;
    if (row->reason.empty()) {
      row->state = RowState::kUpToDate;
      if (earlier->exit == kExitPartial) row->reason = "some cameras or frames are left out", result_.partial = true;
    } else if (o_.dry_run) {
      row->state = RowState::kToDo, row->need = stage.need;
      to_do_.push_back(&stage);
    } else {
      Do(stage, std::move(now), row);
    }
  }

  /// A stage that is not asked for, and whose result is not what it would make now.
  void NoteIfOlder(const PipelineStage& stage) {
    if (!stage.left_out.empty() || !std::filesystem::exists(stage.output)) return;
    const StageRecord* earlier = Earlier(stage);
    if (!earlier && stages::IsNewerThanInputs(stage)) return;
    const std::string why = stages::WhyStale(stage, stages::RecordOf(stage, MVSTUDIO_VERSION, earlier), earlier);
    if (!why.empty()) older_.emplace_back(&stage, earlier ? why : "older than what it is made of");
  }

  void WarnOfOlder(const PipelineStage& stage) {
    for (const auto& [older, why] : older_) {
      if (stage.kind == StageKind::kReport || !stages::Reads(stage, *older)) continue;
      result_.warnings.push_back({"RUN-OLDER",
                                  stage.name() + " reads what " + older->name() + " writes, and that is not up to date: " + why,
                                  "--from " + std::string(ToString(older->kind)) + " does both"});
    }
  }

  /// A dry run only: the stage to be done whose output this one reads.
  std::string AfterStage(const PipelineStage& stage) const {
    const auto found = std::find_if(to_do_.begin(), to_do_.end(),
                                    [&](const PipelineStage* earlier) { return stages::Reads(stage, *earlier); });
    return found == to_do_.end() ? "" : (*found)->name();
  }

  void Do(const PipelineStage& stage, StageRecord record, StageRow* row) {
    const StageKeeper keep = [&](const StageRecord* kept) { Keep(stage, kept); };
    const CommandResult done = DoStage(stage, std::move(record), Earlier(stage), {o_.accept, o_.again}, keep, context_, row);
    result_.partial = result_.partial || row->state == RowState::kPartial;
    for (const Notice& warning : done.warnings) Pass(*row, warning, &result_.warnings);
    for (const Notice& error : done.errors)
      Pass(*row, error, row->state == RowState::kFailed ? &result_.errors : &result_.warnings);
    if (row->state != RowState::kFailed) return;
    if (!stopped_) result_.exit = done.exit;
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
    records_.erase(stage.name());
    if (record) records_[stage.name()] = *record;
    stages::WriteStageRecords(records_path_, records_);
  }

  void Summarise() {
    double seconds = 0;
    for (const StageRow& row : rows_) {
      if (row.state == RowState::kNotAsked) continue;
      const std::string time = std::isfinite(row.seconds) ? Format("%.1f s", row.seconds) : "";
      result_.text += Format("%-24s %-16s %10s %s %s\n", row.stage.c_str(), std::string(ToString(row.state)).c_str(),
                             time.c_str(), o_.dry_run ? NeedText(row.need).c_str() : "", row.reason.c_str());
      if (row.state == RowState::kToDo && std::isfinite(row.seconds)) seconds += row.seconds;
    }
    if (o_.dry_run && seconds > 0) result_.text += Format("about %.0f s, as long as it took last time\n", seconds);
    result_.metrics["stages"] = stages::RowsJson(rows_);
    if (o_.dry_run) result_.partial = false;
    for (size_t i = 0; i < rows_.size(); ++i) {
      const bool made = rows_[i].state == RowState::kDone || rows_[i].state == RowState::kPartial;
      if (made && std::filesystem::exists(stages_[i].output)) result_.outputs.push_back({stages_[i].output, ""});
    }
  }

  const stages::PipelineOptions& o_;
  CommandContext& context_;
  const std::string records_path_;
  StageRecords records_;
  std::vector<PipelineStage> stages_;
  std::vector<const PipelineStage*> to_do_;
  std::vector<std::pair<const PipelineStage*, std::string>> older_;  ///< and why
  std::vector<StageRow> rows_;
  CommandResult result_;
  std::set<std::string> said_;
  bool stopped_ = false;
};

}  // namespace

void RegisterRun(CLI::App& app, Registry& registry) {
  auto options = std::make_shared<stages::PipelineOptions>();
  CLI::App* sub =
      app.add_subcommand("run", "A session from footage to a scored avatar and its report: what is not up to date is done");
  AddOption(sub, "session", options->session, "the session's folder")->required();
  VisitFields(OptionAdder{sub}, *options);
  registry.Add(sub, "run", [options](CommandContext& context) { return Pipeline(*options, context).Run(); });
}

}  // namespace mvstudio::cli
