#include <algorithm>
#include <filesystem>
#include <optional>
#include <set>

#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "cli/program/stage.h"
#include "core/disk/lock.h"
#include "core/format.h"
#include "core/join.h"
#include "core/log.h"
#include "stages/pipeline/record.h"
#include "stages/report_fields.h"

namespace mvstudio::cli {
namespace {

using stages::PipelineStage;
using stages::StageKind;
using stages::StageRecord;
using stages::StageRecords;

/// What became of a stage.
enum class RowState { kUpToDate, kLeftOut, kNotAsked, kDone, kPartial, kAccepted, kWithout, kFailed, kNotReached, kToDo };

constexpr ChoiceWords<RowState, 10> kStateWords = {{{RowState::kUpToDate, "up to date"},
                                                    {RowState::kLeftOut, "not needed"},
                                                    {RowState::kNotAsked, "not asked for"},
                                                    {RowState::kDone, "done"},
                                                    {RowState::kPartial, "done in part"},
                                                    {RowState::kAccepted, "accepted"},
                                                    {RowState::kWithout, "gone on without"},
                                                    {RowState::kFailed, "failed"},
                                                    {RowState::kNotReached, "not reached"},
                                                    {RowState::kToDo, "to do"}}};
std::string_view ToString(RowState state) { return WordOf(kStateWords, state); }

struct StageRow {
  std::string stage, reason, command;
  RowState state = RowState::kNotReached;
  double seconds = NAN;  ///< to do: as long as it took last time
  int exit = 0;
};

template <class Visitor>
void VisitFields(Visitor&& visit, const StageRow& row) {
  visit("stage", row.stage);
  visit("state", row.state);
  visit("reason", row.reason);
  visit("seconds", row.seconds);
  visit("exit", row.exit);
  visit("command", row.command);
}

/// Commands that replace what they wrote earlier without being told to.
bool IsToldToReplace(StageKind kind) {
  return kind != StageKind::kVerify && kind != StageKind::kPack && kind != StageKind::kReport;
}

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
    const StageRecord* earlier = Earlier(stage);
    StageRecord now = stages::RecordOf(stage, MVSTUDIO_VERSION, earlier);
    row->reason = stages::WhyStale(stage, now, earlier);
    if (!row->reason.empty() && !earlier && stages::IsNewerThanInputs(stage)) {
      now.found = true;
      row->reason = "found, newer than what it is made of";
      row->state = RowState::kUpToDate;
      if (!o_.dry_run) Keep(stage, std::move(now));
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
      row->state = RowState::kToDo;
      to_do_.push_back(&stage);
    } else {
      Do(stage, std::move(now), row);
    }
  }

  /// A dry run only: the stage to be done whose output this one reads.
  std::string AfterStage(const PipelineStage& stage) const {
    for (const PipelineStage* earlier : to_do_) {
      for (const std::string& input : stage.inputs) {
        const std::string folder = std::filesystem::path(earlier->output).parent_path().string() + "/";
        if (input == earlier->output || input.rfind(earlier->output + "/", 0) == 0 ||
            (std::filesystem::path(earlier->output).has_extension() && input.rfind(folder, 0) == 0))
          return earlier->name();
      }
    }
    return "";
  }

  /// `record`: its inputs as they are before. What others made, and is older than its inputs, is replaced with --again alone.
  void Do(const PipelineStage& stage, StageRecord record, StageRow* row) {
    std::vector<std::string> words = stage.Words("--");
    const bool known = Earlier(stage) != nullptr;
    if (IsToldToReplace(stage.kind) && !known && !o_.again && std::filesystem::exists(stage.output)) return Refuse(stage, row);
    if (IsToldToReplace(stage.kind) && (known || o_.again)) words.push_back("--overwrite");
    record.exit = stages::kBegun;
    Keep(stage, record);
    Log(LogLevel::kInfo, row->stage + " (" + row->reason + "): mvstudio " + Join(words, " "));
    const LineOutcome outcome = RunStage(words, context_);
    row->exit = outcome.result.exit;
    row->seconds = outcome.json.is_object() ? outcome.json["timing"].value("wall_s", NAN) : NAN;
    for (const Notice& warning : outcome.result.warnings) Pass(*row, warning, &result_.warnings);
    Judge(stage, outcome.result, row);
    record.output = stages::FingerprintOf(stage.output);
    record.exit = row->exit;
    if (std::isfinite(row->seconds)) record.seconds = row->seconds;
    if (row->state == RowState::kAccepted) record.accepted = o_.accept;
    if (row->exit == kExitUsage && !known) return Forget(stage);
    Keep(stage, std::move(record));
  }

  void Refuse(const PipelineStage& stage, StageRow* row) {
    row->state = RowState::kFailed, row->reason = "RUN-EXISTS", row->exit = result_.exit = kExitUsage;
    result_.errors.push_back(
        {"RUN-EXISTS", row->stage + ": " + stage.output + " was made by other means and is older than what it is made of",
         "--again replaces it; move it away to keep it"});
    stopped_ = true;
  }

  /// It refused what was in its way, and has to refuse it the next time.
  void Forget(const PipelineStage& stage) {
    records_.erase(stage.name());
    stages::WriteStageRecords(records_path_, records_);
  }

  void Judge(const PipelineStage& stage, const CommandResult& done, StageRow* row) {
    const bool accepted = done.exit == kExitQualityGate && !done.errors.empty() &&
                          std::all_of(done.errors.begin(), done.errors.end(), [&](const Notice& error) {
                            return std::find(o_.accept.begin(), o_.accept.end(), error.code) != o_.accept.end();
                          });
    const bool without = stage.may_fail && (done.exit == kExitQualityGate || done.exit == kExitIllPosed);
    if (done.exit == kExitOk || done.exit == kExitPartial) {
      row->state = done.exit == kExitOk ? RowState::kDone : RowState::kPartial;
      result_.partial = result_.partial || done.exit == kExitPartial;
    } else {
      row->state = accepted ? RowState::kAccepted : without ? RowState::kWithout : RowState::kFailed;
      row->reason = done.errors.empty() ? "exit code " + std::to_string(done.exit) : done.errors.front().code;
    }
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

  void Keep(const PipelineStage& stage, StageRecord record) {
    records_[stage.name()] = std::move(record);
    stages::WriteStageRecords(records_path_, records_);
  }

  void Summarise() {
    double seconds = 0;
    for (const StageRow& row : rows_) {
      if (row.state == RowState::kNotAsked) continue;
      const std::string time = std::isfinite(row.seconds) ? Format("%.1f s", row.seconds) : "";
      result_.text += Format("%-24s %-16s %10s  %s\n", row.stage.c_str(), std::string(ToString(row.state)).c_str(),
                             time.c_str(), row.reason.c_str());
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
