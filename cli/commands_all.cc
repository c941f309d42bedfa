#include "cli/program/commands.h"
#include "cli/program/companion.h"
#include "cli/program/options.h"

/// What `mvstudio-avatar` knows: every command.
namespace mvstudio::cli {

bool Runs(char**) { return true; }

void RegisterAll(CLI::App& app, Registry& registry) {
  RegisterDemo(app, registry);
  RegisterSynth(app, registry);
  RegisterSession(app, registry);
  RegisterBoard(app, registry);
  RegisterCalibrate(app, registry);
  RegisterCalib(app, registry);
  RegisterModels(app, registry);
  RegisterPose2d(app, registry);
  RegisterMask(app, registry);
  RegisterSync(app, registry);
  RegisterTriangulate(app, registry);
  RegisterTradeoff(app, registry);
  RegisterTradeoffAvatar(*app.get_subcommand("tradeoff"), registry);
  RegisterDataset(app, registry);
  CLI::App* avatar = app.add_subcommand("avatar", "Train, score and render avatars");
  avatar->require_subcommand(1);
  RegisterAvatarFit(*avatar, registry);
  RegisterAvatarTrain(*avatar, registry);
  RegisterAvatarEval(*avatar, registry);
  RegisterAvatarCompare(*avatar, registry);
  RegisterAvatarLift(*avatar, registry);
  RegisterAvatarRender(*avatar, registry);
  RegisterMetrics(app, registry);
  RegisterReport(app, registry);
  RegisterDoctor(app, registry);
  RegisterVersion(app, registry);
}

}  // namespace mvstudio::cli
