#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "stages/session/describe.h"

namespace mvstudio::cli {
namespace {

void RegisterInit(CLI::App* session, Registry& registry) {
  auto options = std::make_shared<stages::SessionInitOptions>();
  CLI::App* sub = session->add_subcommand("init", "Make a session: its folders and a commented mvstudio.toml");
  AddOutput(sub, "folder", options->folder, OutputKind::kFolder, "the session's folder")->required();
  AddOptions(sub, *options);
  sub->get_option("--units")->required();
  sub->get_option("--fps")->check(CLI::PositiveNumber);
  registry.Add(sub, "session init", [options](CommandContext&) { return Describe(stages::RunSessionInit(*options)); });
}

void RegisterShow(CLI::App* session, Registry& registry) {
  auto options = std::make_shared<stages::SessionShowOptions>();
  CLI::App* sub = session->add_subcommand("show", "Cameras, takes and footage, and what is wrong with them");
  AddOption(sub, "folder", options->folder, "the session's folder")->required();
  AddOptions(sub, *options);
  registry.Add(sub, "session show",
               [options](CommandContext& context) { return Describe(stages::RunSessionShow(*options, context.run)); });
}

void RegisterTrust(CLI::App* session, Registry& registry) {
  auto options = std::make_shared<stages::SessionTrustOptions>();
  CLI::App* sub = session->add_subcommand("trust", "Let a session read its footage outside its folder from now on");
  AddOption(sub, "folder", options->folder, "the session's folder")->required();
  AddOptions(sub, *options);
  registry.Add(sub, "session trust", [options](CommandContext&) { return Describe(stages::RunSessionTrust(*options)); });
}

void RegisterTimeline(CLI::App* session, Registry& registry) {
  auto options = std::make_shared<stages::SessionTimelineOptions>();
  CLI::App* sub =
      session->add_subcommand("timeline", "Which frame of each camera shows each time step; dropped and doubled frames");
  AddOption(sub, "folder", options->folder, "the session's folder")->required();
  AddOptions(sub, *options);
  sub->get_option("--max-residual-ms")->check(CLI::NonNegativeNumber);
  registry.Add(sub, "session timeline",
               [options](CommandContext& context) { return Describe(stages::RunSessionTimeline(*options, context.run)); });
}

}  // namespace

void RegisterSession(CLI::App& app, Registry& registry) {
  CLI::App* session = app.add_subcommand("session", "Sessions: folders with footage and mvstudio.toml");
  session->require_subcommand(1);
  RegisterInit(session, registry);
  RegisterShow(session, registry);
  RegisterTrust(session, registry);
  RegisterTimeline(session, registry);
}

}  // namespace mvstudio::cli
