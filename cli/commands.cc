#include "cli/program/commands.h"

#include <cstring>

#include "cli/program/companion.h"
#include "cli/program/options.h"

/// What `mvstudio` knows: the commands that do without libtorch.
namespace mvstudio::cli {
namespace {

/// No allocation, no exception: it is asked before anything is prepared.
bool IsOneOf(const char* word, std::initializer_list<const char*> words) {
  bool found = false;
  for (const char* candidate : words) found = found || (word && !std::strcmp(word, candidate));
  return found;
}

}  // namespace

bool Runs(char** argv) {
  if (!MVSTUDIO_HAS_AVATAR) return true;  // the only program there is
  const char* const first = argv[0] ? argv[1] : nullptr;
  if (IsOneOf(first, {"tradeoff"})) return IsOneOf(argv[2], {"calibrate", "triangulate", "pack"});
  return IsOneOf(first, {"board", "calib", "calibrate", "dataset", "doctor", "report", "session", "sync", "synth",
                         "triangulate", "version"});
}

void RegisterAll(CLI::App& app, Registry& registry) {
  RegisterSynth(app, registry);
  RegisterSession(app, registry);
  RegisterBoard(app, registry);
  RegisterCalibrate(app, registry);
  RegisterCalib(app, registry);
  RegisterSync(app, registry);
  RegisterTriangulate(app, registry);
  RegisterTradeoff(app, registry);
  RegisterDataset(app, registry);
  if (!MVSTUDIO_HAS_AVATAR) RegisterMetrics(app, registry);
  RegisterReport(app, registry);
  RegisterDoctor(app, registry);
  RegisterVersion(app, registry);
}

}  // namespace mvstudio::cli
