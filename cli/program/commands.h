#pragma once

#include "cli/program/command.h"

/// One function a command file; each adds its subcommands to `app` (Tradeoff*, Avatar*, Dataset*: to the subcommand of that
/// name) and registers what they run. Their list is in cli/commands.cc.
namespace mvstudio::cli {

void RegisterDemo(CLI::App& app, Registry& registry);
void RegisterSynth(CLI::App& app, Registry& registry);
void RegisterBoard(CLI::App& app, Registry& registry);
void RegisterCalibrate(CLI::App& app, Registry& registry);
void RegisterCalib(CLI::App& app, Registry& registry);
void RegisterTradeoffAll(CLI::App& tradeoff, Registry& registry);
void RegisterTradeoffCalibrate(CLI::App& tradeoff, Registry& registry);
void RegisterTradeoffTriangulate(CLI::App& tradeoff, Registry& registry);
void RegisterTradeoffPack(CLI::App& tradeoff, Registry& registry);
void RegisterTradeoffPredictions(CLI::App& tradeoff, Registry& registry);
void RegisterTradeoffAvatar(CLI::App& tradeoff, Registry& registry);
void RegisterSync(CLI::App& app, Registry& registry);
void RegisterTriangulate(CLI::App& app, Registry& registry);
void RegisterErrorBudget(CLI::App& app, Registry& registry);
void RegisterMarkers(CLI::App& app, Registry& registry);
void RegisterModels(CLI::App& app, Registry& registry);
void RegisterPose2d(CLI::App& app, Registry& registry);
void RegisterMask(CLI::App& app, Registry& registry);
void RegisterDataset(CLI::App& app, Registry& registry);
void RegisterDatasetVerify(CLI::App& dataset, Registry& registry);
void RegisterDatasetImport(CLI::App& dataset, Registry& registry);
void RegisterDatasetPack(CLI::App& dataset, Registry& registry);
void RegisterDatasetSplit(CLI::App& dataset, Registry& registry);
void RegisterDatasetExport(CLI::App& dataset, Registry& registry);
void RegisterAvatarTemplate(CLI::App& avatar, Registry& registry);
void RegisterAvatarMesh(CLI::App& avatar, Registry& registry);
void RegisterAvatarFit(CLI::App& avatar, Registry& registry);
void RegisterAvatarTexture(CLI::App& avatar, Registry& registry);
void RegisterAvatarEdit(CLI::App& avatar, Registry& registry);
void RegisterAvatarPretrain(CLI::App& avatar, Registry& registry);
void RegisterAvatarPretrainRenderer(CLI::App& avatar, Registry& registry);
void RegisterAvatarTrain(CLI::App& avatar, Registry& registry);
void RegisterAvatarInfo(CLI::App& avatar, Registry& registry);
void RegisterAvatarEval(CLI::App& avatar, Registry& registry);
void RegisterAvatarCompare(CLI::App& avatar, Registry& registry);
void RegisterAvatarLift(CLI::App& avatar, Registry& registry);
void RegisterAvatarRender(CLI::App& avatar, Registry& registry);
void RegisterAvatarSurface(CLI::App& avatar, Registry& registry);
void RegisterMetrics(CLI::App& app, Registry& registry);
void RegisterReport(CLI::App& app, Registry& registry);
void RegisterRender(CLI::App& app, Registry& registry);
void RegisterView(CLI::App& app, Registry& registry);
void RegisterSession(CLI::App& app, Registry& registry);
void RegisterRun(CLI::App& app, Registry& registry);
void RegisterPlan(CLI::App& app, Registry& registry);
void RegisterTask(CLI::App& app, Registry& registry);
void RegisterJobs(CLI::App& app, Registry& registry);
void RegisterDoctor(CLI::App& app, Registry& registry);
void RegisterVersion(CLI::App& app, Registry& registry);

}  // namespace mvstudio::cli
