#include <filesystem>
#include <map>
#include <memory>

#include "avatar/body/role_bones.h"
#include "avatar/body/smpl/read.h"
#include "avatar/body/templates/read.h"
#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "core/disk/files.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "core/format.h"
#include "core/join.h"

/// `avatar template`, which does without libtorch.
namespace mvstudio::cli {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

struct TemplateArguments {
  std::string source, out;
};

bool IsSmpl(const std::string& source) { return source != "mannequin" && !fs::is_directory(source); }

/// Names of the bones of each role, in the order of the roles.
std::map<body::BoneRole, std::vector<std::string>> BonesByRole(const body::BodyTemplate& body) {
  std::map<body::BoneRole, std::vector<std::string>> bones;
  for (size_t b = 0; b < body.bone_names.size(); ++b) bones[body.bone_roles[b]].push_back(body.bone_names[b]);
  return bones;
}

float HeightOf(const body::BodyTemplate& body) { return body.vertices.row(2).maxCoeff() - body.vertices.row(2).minCoeff(); }

ordered_json ToJson(const body::BodyTemplate& body) {
  ordered_json json{{"vertices", body.vertices.cols()},
                    {"faces", body.faces.cols()},
                    {"height_m", HeightOf(body)},
                    {"bones", body.bone_names.size()},
                    {"roles", ordered_json::object()},
                    {"shapes", body.shapes.names},
                    {"pose_directions", body.pose_directions.cols()}};
  for (const auto& [role, names] : BonesByRole(body)) json["roles"][std::string(ToString(role))] = names;
  return json;
}

std::string ToText(const body::BodyTemplate& body) {
  std::string text = Format("vertices          %d\nfaces             %d\nheight            %.2f m\nbones             %zu\n",
                            static_cast<int>(body.vertices.cols()), static_cast<int>(body.faces.cols()),
                            static_cast<double>(HeightOf(body)), body.bone_names.size());
  for (const auto& [role, names] : BonesByRole(body)) {
    const std::string word(ToString(role));
    if (role != body::BoneRole::kOther) text += Format("  %-15s %s\n", word.c_str(), Join(names, ", ").c_str());
  }
  const size_t others = BonesByRole(body)[body::BoneRole::kOther].size();
  return text + Format("  %-15s %zu, which follow their parents\nshapes            %zu\npose directions   %d\n", "other",
                       others, body.shapes.names.size(), static_cast<int>(body.pose_directions.cols()));
}

void RequireFreeName(const TemplateArguments& arguments) {
  if (fs::path(arguments.out).extension() != ".npz") throw UsageError("--out " + arguments.out + ": must end in .npz");
  if (!IsSmpl(arguments.source))
    throw UsageError("--out: only a .pkl or .npz file is written in SMPL's layout, for " + arguments.source +
                     " has another skeleton; leave out --out, and give " + arguments.source + " itself to --template");
  if (fs::exists(fs::symlink_status(arguments.out)))
    throw UsageError("--out " + arguments.out + " exists: choose another name, or move it away");
}

CommandResult Run(const TemplateArguments& arguments) {
  if (arguments.source != "mannequin" && !fs::exists(arguments.source))
    throw IoError(arguments.source,
                  "no such file or folder; it must be mannequin, a folder of MakeHuman, or a .npz or .pkl file");
  CommandResult result;
  if (arguments.source != "mannequin") result.inputs = {arguments.source};
  std::unique_ptr<OutputFiles> place;
  if (!arguments.out.empty()) {
    place = std::make_unique<OutputFiles>(std::vector<std::string>{arguments.out}, result.inputs);
    RequireFreeName(arguments);
  }
  std::map<std::string, NpyArray> arrays;
  if (IsSmpl(arguments.source)) arrays = body::ReadSmplArrays(arguments.source);
  const body::BodyTemplate body =
      arrays.empty() ? body::ReadTemplate(arguments.source) : body::SmplFromArrays(arrays, arguments.source);
  result.metrics = ToJson(body);
  result.text = ToText(body);
  if (place) {
    WriteFileAtomic(arguments.out, body::SmplNpz(arrays, arguments.source));
    result.outputs.push_back({arguments.out, "body-template"});
  }
  return result;
}

}  // namespace

void RegisterAvatarTemplate(CLI::App& avatar, Registry& registry) {
  auto arguments = std::make_shared<TemplateArguments>();
  CLI::App* sub =
      avatar.add_subcommand("template", "Tell what a body template holds; .pkl files as .npz, without running them");
  AddOption(sub, "source", arguments->source,
            "mannequin, a folder of MakeHuman's base mesh, rigs and targets, or a .npz or .pkl file in SMPL's layout")
      ->required();
  AddOutput(sub, "--out", arguments->out, OutputKind::kFile,
            "new .npz file in SMPL's layout, for --template and numpy; a file that exists is kept");
  registry.Add(sub, "avatar template", [arguments](CommandContext&) { return Run(*arguments); });
}

}  // namespace mvstudio::cli
