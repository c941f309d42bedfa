#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "stages/triangulate/describe.h"
#include "stages/triangulate/run.h"

namespace mvstudio::cli {

void RegisterTriangulate(CLI::App& app, Registry& registry) {
  auto options = std::make_shared<stages::TriangulateOptions>();
  CLI::App* sub = app.add_subcommand("triangulate", "2D joints of several cameras -> 3D joints");
  VisitFields(OptionAdder{sub}, *options);  // --overwrite joins the last subject
  registry.Add(sub, "triangulate", [options, sub](CommandContext& context) {
    options->given = GivenOptions(sub);
    options->file_text = WithFlags;
    return Describe(stages::RunTriangulate(*options, context.run));
  });
}

}  // namespace mvstudio::cli
