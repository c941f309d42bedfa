#include <memory>

#include "avatar/body/files/textured_person.h"
#include "avatar/body/measure/body_scores.h"
#include "avatar/body/measure/known_surface.h"
#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "stages/people/surface_scores.h"

namespace mvstudio::cli {
namespace {

struct SurfaceArguments {
  std::vector<std::string> bodies;
  std::string truth;
  body::BodyScoreOptions options;
};

CommandResult RunSurface(const SurfaceArguments& arguments, CommandContext& context) {
  const body::KnownSurface truth(arguments.truth);
  CommandResult result;
  result.inputs = arguments.bodies;
  result.inputs.push_back(arguments.truth);
  result.metrics["bodies"] = nlohmann::ordered_json::array();
  result.text = stages::SurfaceTableHead();
  for (const std::string& path : arguments.bodies)
    stages::AddSurfaceScores(path, body::ScoreBody(body::ReadPerson(path), truth, arguments.options, context.run), &result);
  if (result.text == stages::SurfaceTableHead()) result.text.clear();
  return result;
}

}  // namespace

void RegisterAvatarSurface(CLI::App& avatar, Registry& registry) {
  auto a = std::make_shared<SurfaceArguments>();
  CLI::App* sub = avatar.add_subcommand("surface", "Fitted bodies beside the true surface of a rendered person");
  AddOption(sub, "bodies", a->bodies, "body.npz files of avatar fit")->required();
  AddOption(sub, "--truth", a->truth, "session of synth, dataset with a folder truth, or that folder")->required();
  AddOptions(sub, a->options);
  registry.Add(sub, "avatar surface", [a](CommandContext& context) { return RunSurface(*a, context); });
}

}  // namespace mvstudio::cli
