#include "cli/help/short_help.h"

#include <algorithm>
#include <memory>
#include <set>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "core/check.h"

namespace mvstudio::cli {
namespace {

struct CommonOptions {
  const char *command, *options;
};

/// Required options and positionals are always shown.
constexpr CommonOptions kCommon[] = {
    {"calibrate",
     "--board --camera --corners --from-scene --scene-points --session --take --every --max-frames --size --model "
     "--share-intrinsics "
     "--start --fix --holdout --split-at --world --out"},
    {"calib refine",
     "--board --camera --corners --session --take --from-keypoints --pose2d --points2d --skeleton --train-frames --test-frames "
     "--max-persons --fix --model --out"},
    {"triangulate",
     "--calib --pose2d --points2d --skeleton --session --take --out --method --min-score --max-persons --sync --refine "
     "--chunk-frames "
     "--to --filter --fill --truth"},
    {"pose2d",
     "--video --images --session --take --calib --out --backend --quality --max-persons --skeleton --overlays --overwrite"},
    {"mask",
     "--video --images --plate --session --take --calib --pose3d --pose2d --backend --soft --hull --truth --out --overwrite"},
    {"dataset build",
     "--calib --video --images --plate --session --take --pose3d --masks --png --jpeg-quality --size-rule --require-complete "
     "--out "
     "--overwrite"},
    {"dataset pack",
     "--cameras --frames --split --codec --crop --full --undistort --match-colours --masks --person --shard --merge --single"},
    {"avatar pretrain",
     "--motion --poses --template --out --inputs --width --size --steps --batch --samples --device --overwrite"},
    {"avatar train",
     "--train-cameras --holdout-cameras --holdout-frames --split --validate-camera --patience --method --prior --inputs "
     "--pose3d "
     "--width --size --steps --batch --init-from --device --ranks --overwrite"},
};

bool IsOn(const CLI::Option* option) { return option->get_default_str() == "true"; }

class PlainFlags : public CLI::Formatter {
 public:
  std::string make_option_name(const CLI::Option* option, bool is_positional) const override {
    if (!HasBoth(option)) return CLI::Formatter::make_option_name(option, is_positional);
    for (const std::string& name : option->get_lnames()) {
      if (IsOff(option, name) == IsOn(option)) return "--" + name;
    }
    return CLI::Formatter::make_option_name(option, is_positional);
  }
  std::string make_option_opts(const CLI::Option* option) const override {
    return HasBoth(option) ? "" : CLI::Formatter::make_option_opts(option);
  }
  std::string make_option_desc(const CLI::Option* option) const override {
    const std::string text = CLI::Formatter::make_option_desc(option);
    return HasBoth(option) && IsOn(option) ? "on unless this is given: " + text : text;
  }

 private:
  static bool IsOff(const CLI::Option* option, const std::string& name) {
    const auto& off = option->get_fnames();
    return std::find(off.begin(), off.end(), name) != off.end();
  }
  static bool HasBoth(const CLI::Option* option) {
    return option->get_items_expected_max() == 0 && !option->get_fnames().empty();
  }
};

/// So that it fits a screen.
std::string WithoutEmptyLines(const std::string& text) {
  std::string lines;
  for (const char c : text) {
    if (c != '\n' || (!lines.empty() && lines.back() != '\n')) lines += c;
  }
  return lines;
}

/// Options under the subjects that they were declared with; `--help` without those that are seldom needed.
class ShortFormatter : public PlainFlags {
 public:
  explicit ShortFormatter(std::set<const CLI::Option*> seldom) : seldom_(std::move(seldom)) {}

  std::string make_help(const CLI::App* app, std::string name, CLI::AppFormatMode mode) const override {
    all_ = mode == CLI::AppFormatMode::All || seldom_.empty();
    const std::string help = PlainFlags::make_help(app, name, mode);
    if (all_) return help;
    return WithoutEmptyLines(help) + std::to_string(seldom_.size()) + " more with --help-all\n" + app->get_footer() + "\n";
  }
  std::string make_footer(const CLI::App* app) const override { return all_ ? PlainFlags::make_footer(app) : ""; }
  std::string make_group(std::string group, bool is_positional, std::vector<const CLI::Option*> options) const override {
    const auto is_seldom = [this](const CLI::Option* option) { return !all_ && seldom_.count(option) > 0; };
    options.erase(std::remove_if(options.begin(), options.end(), is_seldom), options.end());
    return options.empty() ? "" : PlainFlags::make_group(group, is_positional, options);
  }

 private:
  std::set<const CLI::Option*> seldom_;
  mutable bool all_ = false;  // CLI11 asks for a group without saying what for
};

}  // namespace

CLI::App* CommandNamed(CLI::App& app, const std::string& words) {
  CLI::App* command = &app;
  std::istringstream in(words);
  for (std::string word; command && in >> word;) {
    const auto found = command->get_subcommands([&](CLI::App* sub) { return sub->get_name() == word; });
    command = found.empty() ? nullptr : found.front();
  }
  return command;
}

namespace {

std::set<const CLI::Option*> AllBut(CLI::App* command, const std::string& names) {
  std::vector<const CLI::Option*> front;
  std::istringstream in(names);
  for (std::string name; in >> name;) {
    front.push_back(command->get_option_no_throw(name));
    MVS_CHECK(front.back(), "an option that is to be shown and does not exist: " << name);
  }
  std::set<const CLI::Option*> seldom;
  for (const CLI::Option* option : command->get_options()) {
    const bool shown = option->get_required() || option->get_positional() || option == command->get_help_ptr() ||
                       std::find(front.begin(), front.end(), option) != front.end();
    if (!shown) seldom.insert(option);
  }
  return seldom;
}

}  // namespace

void UsePlainFlags(CLI::App& app) { app.formatter(std::make_shared<PlainFlags>()); }

void ShortenHelp(CLI::App& app) {
  app.set_help_all_flag("--help-all", "Print all options of a command, and exit");
  for (const CommonOptions& common : kCommon) {
    CLI::App* command = CommandNamed(app, common.command);
    if (!command) continue;  // needs libtorch, and this program has none
    command->formatter(std::make_shared<ShortFormatter>(AllBut(command, common.options)));
  }
}

}  // namespace mvstudio::cli
