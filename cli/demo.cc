#include <cmath>

#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "cli/program/redact.h"
#include "cli/program/result.h"
#include "cli/program/stage.h"
#include "core/disk/files.h"
#include "stages/demo/describe.h"

namespace mvstudio::cli {
namespace {

/// The report reads saved results, so the demo's own must be there before it.
void KeepDemo(const stages::DemoReport& report, const CommandContext& context) {
  double seconds = 0;
  for (const stages::StageRow& row : report.rows) seconds += std::isfinite(row.seconds) ? row.seconds : 0;
  const nlohmann::ordered_json json = ResultToJson("demo", Describe(report), seconds, context.argv);
  WriteFileAtomic(report.options.out + "/demo.result.json", JsonText(RedactedJson(json)));
}

}  // namespace

void RegisterDemo(CLI::App& app, Registry& registry) {
  const auto options = std::make_shared<stages::DemoOptions>();
  CLI::App* sub = app.add_subcommand("demo", "The whole pipeline on the built-in synthetic studio, ending in a report");
  AddOptions(sub, *options);
  NameOutput(sub->get_option("--out"), OutputKind::kFolder);
  registry.Add(sub, "demo", [options](CommandContext& context) {
    const auto keep = [&](const stages::DemoReport& report) { KeepDemo(report, context); };
    return Describe(RunDemo(*options, {{CallsIn(context), MVSTUDIO_VERSION}, keep}));
  });
}

}  // namespace mvstudio::cli
