#include "cli/program/run_line.h"

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <optional>
#include <utility>

#include "cli/help/examples.h"
#include "cli/help/short_help.h"
#include "cli/help/wrap.h"
#include "cli/program/arguments.h"
#include "cli/program/flag_text.h"
#include "cli/program/options.h"
#include "cli/program/places.h"
#include "cli/program/redact.h"
#include "cli/program/result.h"
#include "cli/program/up_to_date.h"
#include "core/check.h"
#include "core/disk/lock.h"
#include "core/disk/manifest.h"
#include "core/disk/replace.h"
#include "core/error.h"
#include "stages/dataset/studio_names.h"

namespace mvstudio::cli {
namespace {

using Clock = std::chrono::steady_clock;

void AddGlobalOptions(CLI::App& app, GlobalOptions& global) {
  AddFlag(&app, "--json", global.json, "print exactly one JSON object on stdout");
  AddOption(&app, "--threads", global.threads, "threads; 0: as many as the machine has")->capture_default_str();
  AddOption(&app, "--seed", global.seed, "seed of everything random")->capture_default_str();
  AddOption(&app, "--log-level", global.log_level, "debug, info, warning, error or off")
      ->capture_default_str()
      ->check(OneOf({"debug", "info", "warning", "error", "off"}));
  AddOption(&app, "--progress", global.progress, "auto, bar, plain or none")
      ->capture_default_str()
      ->check(OneOf({"auto", "bar", "plain", "none"}));
  AddFlag(&app, "--quiet", global.quiet, "the same as --log-level error --progress none");
  AddFlag(&app, "--redact", global.redact,
          "leave the names of the user and the machine, and where files lie, out of results, provenance and reports");
}

/// Commands that go on with what is there, or that have rules of their own for it; a report says what other results hold.
constexpr const char* kReplacing[] = {"report",
                                      "run",
                                      "task",
                                      "session trust",
                                      "jobs submit",
                                      "jobs retry",
                                      "demo",
                                      "avatar resume",
                                      "avatar pretrain",
                                      "avatar pretrain-renderer",
                                      "avatar template",
                                      "calib click",
                                      "calib lenses add",
                                      "dataset pack",
                                      "dataset verify",
                                      "models fetch"};

bool GoesOn(const std::string& command) {
  return command.rfind("tradeoff ", 0) == 0 ||
         std::find(std::begin(kReplacing), std::end(kReplacing), command) != std::end(kReplacing);
}

/// Commands whose results lie where their input does.
constexpr const char* kWritingBeside[] = {"avatar eval", "session timeline"};

bool Writes(const Registry::Entry& entry) {
  const bool beside = std::find(std::begin(kWritingBeside), std::end(kWritingBeside), entry.name) != std::end(kWritingBeside);
  return beside || entry.app->get_option_no_throw("--out") || entry.app->get_option_no_throw("--repair");
}

/// What may be written over: commands without a rule of their own get the flag.
void AddOverwrite(const Registry& registry) {
  const std::string help = "replace the results of an earlier run";
  for (const Registry::Entry& entry : registry.entries()) {
    if (GoesOn(entry.name) || !Writes(entry) || entry.app->get_option_no_throw("--overwrite")) continue;
    entry.app->add_flag("--overwrite", help);  // MayReplaceResults asks the parser, as for a command's own
  }
}

bool MayReplaceResults(const Registry::Entry& entry) {
  const CLI::Option* flag = entry.app->get_option_no_throw("--overwrite");
  return GoesOn(entry.name) || (flag && flag->count() > 0 && flag->as<bool>());
}

const Registry::Entry* Chosen(const Registry& registry) {
  for (const auto& entry : registry.entries()) {
    if (entry.app->parsed()) return &entry;
  }
  return nullptr;
}

CommandResult UsageResult(const Notice& notice) {
  CommandResult result;
  result.exit = kExitUsage;
  result.errors.push_back(notice);
  return result;
}

/// CLI11 takes the words last first. What looks like one of its lists and is a file is not to be taken apart.
std::vector<std::string> WordsForParser(const std::vector<std::string>& words) {
  std::vector<std::string> reversed(words.rbegin(), words.rend());
  for (std::string& word : reversed) {
    std::error_code ignored;
    const bool list = word.size() > 1 && word.front() == '[' && word.back() == ']';
    if (list && std::filesystem::exists(std::filesystem::symlink_status(word, ignored))) word.insert(0, "./");
  }
  return reversed;
}

/// Files that are written name the command that writes them, a stage of a longer one its own.
struct WriterScope {
  explicit WriterScope(const std::string& command) : before(WriterName()) { SetWriterName(command, MVSTUDIO_VERSION); }
  ~WriterScope() { SetWriterName(before.first, before.second); }
  WriterScope(const WriterScope&) = delete;
  WriterScope& operator=(const WriterScope&) = delete;
  const std::pair<std::string, std::string> before;
};

bool Has(const std::vector<std::string>& words, const std::string& word) {
  return std::find(words.begin(), words.end(), word) != words.end();
}

/// The flags of a line that the parser gave up.
void SeeFlags(const std::vector<std::string>& words, const std::vector<std::string>& argv, GlobalOptions& global) {
  global.json = global.json || Has(words, "--json");
  if (Has(words, "--redact")) StartRedacting(argv);
}

void FinishOutcome(LineOutcome& outcome, const CommandContext& context, double wall_s, const std::vector<std::string>& argv) {
  const WriterScope writer(outcome.command);
  if (outcome.result.partial && outcome.result.exit == kExitOk) outcome.result.exit = kExitPartial;
  outcome.result = stages::NamedCameras(NamedFlags(std::move(outcome.result)), context.camera_names);
  outcome.json = ResultToJson(outcome.command, outcome.result, wall_s, argv);
  outcome.result = Kept(outcome.command, std::move(outcome.result), outcome.json, argv, outcome.record);
  outcome.json = ResultToJson(outcome.command, outcome.result, wall_s, argv);
}

/// Runs the command, unless what it would make is there: then its earlier result is the result.
void RunRecorded(const Registry::Entry& entry, const GlobalOptions& global, const RunEntry& run, CommandContext& context,
                 LineOutcome* outcome) {
  const std::chrono::nanoseconds begun = std::chrono::system_clock::now().time_since_epoch();
  const DiskTrace trace;
  try {
    outcome->result = run(entry, context);
  } catch (const ResultExistsError& kept) {
    std::optional<CommandResult> earlier = EarlierResult(entry, global, kept.path());
    if (!earlier) throw;
    context.camera_names.clear();  // it calls the cameras so
    outcome->result = std::move(*earlier);
    return;
  }
  const bool known_again = !GoesOn(entry.name) && entry.name != "plan";  // a plan reads the state of a whole session
  if (known_again) outcome->record = RecordOfLine(entry, global, outcome->result, trace, begun.count());
}

/// Fills `outcome` but for its JSON object.
void RunParsed(const std::vector<std::string>& words, const std::vector<std::string>& argv, GlobalOptions& global,
               const RunEntry& run, CommandContext& context, LineOutcome* outcome) {
  CLI::App app{"mvstudio: multi-view capture, from footage to scored avatars", "mvstudio"};
  app.fallthrough();
  app.require_subcommand(1);
  app.set_version_flag("--version", std::string("mvstudio ") + MVSTUDIO_VERSION, "print the version and exit");
  UsePlainFlags(app);
  AddGlobalOptions(app, global);
  Registry registry;
  RegisterAll(app, registry);
  AddOverwrite(registry);
  CheckValues(app);
  ShortenHelp(app);
  AddExamples(app);

  try {
    app.parse(WordsForParser(words));
    if (global.redact) StartRedacting(argv);
    if (global.quiet) global.log_level = "error", global.progress = "none";
    const Registry::Entry* entry = Chosen(registry);
    MVS_CHECK(entry, "a command that runs nothing");
    outcome->command = entry->name;
    const WriterScope writer(entry->name);
    const ReplaceScope replacing(MayReplaceResults(*entry));
    Registry::Entry checked = *entry;
    checked.run = [entry](CommandContext& its) {  // a signal is heard by then: the check makes a file and removes it
      CheckPlaces(*entry);
      return entry->run(its);
    };
    RunRecorded(checked, global, run, context, outcome);
  } catch (const CLI::CallForHelp&) {
    outcome->help = WrapHelp(app.help(), HelpWidth());
  } catch (const CLI::CallForAllHelp&) {
    outcome->help = WrapHelp(app.help("", CLI::AppFormatMode::All), HelpWidth());
  } catch (const CLI::CallForVersion& version) {
    outcome->help = version.what() + std::string("\n");
  } catch (const CLI::ParseError& e) {
    SeeFlags(words, argv, global);
    outcome->result = UsageResult(ParseNotice(app, e));
  } catch (...) {
    const Registry::Entry* entry = Chosen(registry);
    if (outcome->command.empty() && entry) {  // a word that an option does not know ended the parsing
      outcome->command = entry->name;
      SeeFlags(words, argv, global);
    }
    outcome->result = ResultOfCurrentException();
  }
}

}  // namespace

LineOutcome RunLine(const std::vector<std::string>& words, GlobalOptions& global, const RunEntry& run) {
  std::vector<std::string> argv = {"mvstudio"};
  argv.insert(argv.end(), words.begin(), words.end());
  LineOutcome outcome;
  const OutputLockScope until_recorded;
  CommandContext context;
  const auto start = Clock::now();
  try {
    RunParsed(words, argv, global, run, context, &outcome);
  } catch (...) {  // in the commands' own parsers: out of memory
    SeeFlags(words, argv, global);
    outcome.result = ResultOfCurrentException();
  }
  FinishOutcome(outcome, context, std::chrono::duration<double>(Clock::now() - start).count(), argv);
  return outcome;
}

}  // namespace mvstudio::cli
