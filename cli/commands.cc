#include "cli/commands.h"

#include "cli/options.h"

namespace mvstudio::cli {

void RegisterAll(CLI::App& app, Registry& registry) {
#if MVSTUDIO_HAS_AVATAR
  RegisterDemo(app, registry);
#endif
  RegisterSynth(app, registry);
  RegisterSession(app, registry);
  RegisterBoard(app, registry);
  RegisterCalibrate(app, registry);
  RegisterCalib(app, registry);
#if MVSTUDIO_HAS_AVATAR
  RegisterModels(app, registry);
  RegisterPose2d(app, registry);
  RegisterMask(app, registry);
#endif
  RegisterSync(app, registry);
  RegisterTriangulate(app, registry);
  RegisterTradeoff(app, registry);
  RegisterDataset(app, registry);
#if MVSTUDIO_HAS_AVATAR
  CLI::App* avatar = app.add_subcommand("avatar", "Train, score and render avatars");
  avatar->require_subcommand(1);
  RegisterAvatarTrain(*avatar, registry);
  RegisterAvatarEval(*avatar, registry);
  RegisterAvatarCompare(*avatar, registry);
  RegisterAvatarLift(*avatar, registry);
  RegisterAvatarRender(*avatar, registry);
#endif
  RegisterMetrics(app, registry);
  RegisterReport(app, registry);
  RegisterDoctor(app, registry);
  RegisterVersion(app, registry);
}

}  // namespace mvstudio::cli
