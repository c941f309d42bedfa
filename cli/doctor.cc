#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "stages/doctor/describe.h"

namespace mvstudio::cli {

void RegisterDoctor(CLI::App& app, Registry& registry) {
  const auto options = std::make_shared<stages::DoctorOptions>();
  CLI::App* sub = app.add_subcommand("doctor", "Check the machine, and a session; lists every problem, not only the first");
  AddOption(sub, "path", options->path, "a session, or a folder of footage");
  AddOptions(sub, *options);
  registry.Add(sub, "doctor", [options](CommandContext& context) {
    return Describe(stages::RunDoctor(*options, context.run), {MVSTUDIO_VERSION, MVSTUDIO_HAS_AVATAR != 0});
  });
}

}  // namespace mvstudio::cli
