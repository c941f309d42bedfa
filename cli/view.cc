#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "cli/program/show_page.h"
#include "report/report.h"
#include "stages/view/describe.h"

namespace mvstudio::cli {
namespace {

std::string ReportPage(const std::string& folder, const std::string& title, bool follow_links) {
  report::ReportOptions options;
  options.version = MVSTUDIO_VERSION;
  options.title = title;
  options.follow_links = follow_links;
  return report::BuildReport(folder, options).html;
}

}  // namespace

void RegisterView(CLI::App& app, Registry& registry) {
  const auto options = std::make_shared<stages::ViewOptions>();
  CLI::App* sub = app.add_subcommand(
      "view", "Show a run, a session, a dataset, a calibration or a take in a browser on this machine, with all frames");
  AddOption(sub, "PATH", options->scene.path,
            "folder of a run, a session or a dataset; a calibration file of any program; points in 3D (.trc, .c3d); footage; "
            "or an MCAP "
            "file, in Rerun's viewer")
      ->required();
  AddOptions(sub, *options);
  sub->get_option("--port")->check(CLI::Range(0, 65535));
  registry.Add(sub, "view", [options](CommandContext& context) {
    const auto page = [&](const std::string& folder, const std::string& title) {
      return ReportPage(folder, title, options->scene.allow_outside);
    };
    return Describe(stages::RunView(*options, page, ShowOn(options->port, "closing its page", options->open), context.run));
  });
}

}  // namespace mvstudio::cli
