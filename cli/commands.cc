#include "cli/program/commands.h"

#include <cstring>
#include <string>

#include "cli/program/companion.h"
#include "cli/program/options.h"
#include "core/check.h"

/// The list of the commands. It is compiled for each of the two programs; MVSTUDIO_ALL_COMMANDS: for `mvstudio-avatar`.
namespace mvstudio::cli {
namespace {

#if MVSTUDIO_ALL_COMMANDS
#define MVSTUDIO_NEEDS_TORCH(add) add, true
#else
#define MVSTUDIO_NEEDS_TORCH(add) nullptr, true  // not linked into `mvstudio`
#endif
#if MVSTUDIO_HAS_AVATAR
#define MVSTUDIO_NEEDS_TORCH_IF_BUILT(add) MVSTUDIO_NEEDS_TORCH(add)
#else
#define MVSTUDIO_NEEDS_TORCH_IF_BUILT(add) add, false  // does less then
#endif

struct Command {
  const char* name;  ///< one word, or two: that of a group first
  void (*add)(CLI::App& parent, Registry& registry);
  bool needs_torch = false;
};

/// In the order of the help.
constexpr Command kCommands[] = {
    {"demo", MVSTUDIO_NEEDS_TORCH(RegisterDemo)},
    {"synth", RegisterSynth},
    {"session", RegisterSession},
    {"run", MVSTUDIO_NEEDS_TORCH_IF_BUILT(RegisterRun)},
    {"plan", RegisterPlan},
    {"task", MVSTUDIO_NEEDS_TORCH_IF_BUILT(RegisterTask)},
    {"jobs", RegisterJobs},
    {"board", RegisterBoard},
    {"calibrate", RegisterCalibrate},
    {"calib", RegisterCalib},
    {"models", MVSTUDIO_NEEDS_TORCH(RegisterModels)},
    {"pose2d", MVSTUDIO_NEEDS_TORCH(RegisterPose2d)},
    {"mask", MVSTUDIO_NEEDS_TORCH(RegisterMask)},
    {"sync", RegisterSync},
    {"triangulate", RegisterTriangulate},
    {"error-budget", RegisterErrorBudget},
    {"markers", RegisterMarkers},
    {"tradeoff all", RegisterTradeoffAll},
    {"tradeoff calibrate", RegisterTradeoffCalibrate},
    {"tradeoff triangulate", RegisterTradeoffTriangulate},
    {"tradeoff pack", RegisterTradeoffPack},
    {"tradeoff predictions", RegisterTradeoffPredictions},
    {"tradeoff avatar", MVSTUDIO_NEEDS_TORCH(RegisterTradeoffAvatar)},
    {"dataset", RegisterDataset},
    {"avatar template", RegisterAvatarTemplate},
    {"avatar mesh", RegisterAvatarMesh},
    {"avatar fit", MVSTUDIO_NEEDS_TORCH(RegisterAvatarFit)},  // and texture, edit
    {"avatar pretrain", MVSTUDIO_NEEDS_TORCH(RegisterAvatarPretrain)},
    {"avatar pretrain-renderer", MVSTUDIO_NEEDS_TORCH(RegisterAvatarPretrainRenderer)},
    {"avatar train", MVSTUDIO_NEEDS_TORCH(RegisterAvatarTrain)},  // and resume, info
    {"avatar eval", MVSTUDIO_NEEDS_TORCH(RegisterAvatarEval)},
    {"avatar compare", MVSTUDIO_NEEDS_TORCH(RegisterAvatarCompare)},
    {"avatar lift", MVSTUDIO_NEEDS_TORCH(RegisterAvatarLift)},
    {"avatar render", MVSTUDIO_NEEDS_TORCH(RegisterAvatarRender)},
    {"avatar surface", RegisterAvatarSurface},
    {"metrics", MVSTUDIO_NEEDS_TORCH_IF_BUILT(RegisterMetrics)},
    {"report", RegisterReport},
    {"view", RegisterView},
    {"render", RegisterRender},
    {"doctor", RegisterDoctor},
    {"version", RegisterVersion},
};

struct Group {
  const char *name, *help;
};
constexpr Group kGroups[] = {
    {"tradeoff", "Measure what speed costs in accuracy"},
    {"avatar", "Train, score and render avatars"},
};

/// Whether `argv` begins with the words of `name`. No allocation, no exception: it is asked before anything is prepared.
bool Begins(char** argv, const char* name) {
  const char* const space = std::strchr(name, ' ');
  const size_t length = space ? static_cast<size_t>(space - name) : std::strlen(name);
  if (!*argv || std::strlen(*argv) != length || std::strncmp(*argv, name, length) != 0) return false;
  return !space || Begins(argv + 1, space + 1);
}

CLI::App* Find(CLI::App& parent, const std::string& name) {
  const auto found = parent.get_subcommands([&](const CLI::App* sub) { return sub->get_name() == name; });
  return found.empty() ? nullptr : found.front();
}

/// The parent of a command; a group is made for the first of its commands.
CLI::App* ParentOf(const std::string& name, CLI::App& app) {
  const size_t space = name.find(' ');
  if (space == std::string::npos) return &app;
  const std::string group = name.substr(0, space);
  if (CLI::App* made = Find(app, group)) return made;
  for (const Group& known : kGroups) {
    if (group != known.name) continue;
    CLI::App* made = app.add_subcommand(group, known.help);
    made->require_subcommand(1);
    return made;
  }
  MVS_CHECK(false, "the command '" + name + "' is of no group");
  return nullptr;
}

}  // namespace

bool Runs(char** argv) {
  if (MVSTUDIO_ALL_COMMANDS || !MVSTUDIO_HAS_AVATAR) return true;
  bool runs = *argv && argv[1] && !argv[2] && std::strcmp(argv[1], "--version") == 0;
  for (const Command& command : kCommands) runs = runs || (!command.needs_torch && *argv && Begins(argv + 1, command.name));
  return runs;
}

void RegisterAll(CLI::App& app, Registry& registry) {
  for (const Command& command : kCommands) {
    if (!command.add) continue;
    const std::string name = command.name;
    CLI::App* parent = ParentOf(name, app);
    command.add(*parent, registry);
    MVS_CHECK(Find(*parent, name.substr(name.rfind(' ') + 1)), "the list names no command '" + name + "'");
  }
}

}  // namespace mvstudio::cli
