#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "stages/error_budget/describe.h"

namespace mvstudio::cli {

void RegisterErrorBudget(CLI::App& app, Registry& registry) {
  auto options = std::make_shared<stages::ErrorBudgetOptions>();
  CLI::App* sub = app.add_subcommand(
      "error-budget", "Which stage an error comes from, what improving it would bring, and whether the sigmas are true");
  VisitFields(OptionAdder{sub}, *options);
  registry.Add(sub, "error-budget",
               [options](CommandContext& context) { return Describe(stages::RunErrorBudget(*options, context.run)); });
}

}  // namespace mvstudio::cli
