#include "stages/body_template/describe.h"

#include <map>

#include "avatar/body/role_bones.h"
#include "core/format.h"
#include "core/join.h"

namespace mvstudio::stages {
namespace {

using BonesOfRoles = std::map<body::BoneRole, std::vector<std::string>>;

/// Names of the bones of each role, in the order of the roles.
BonesOfRoles BonesByRole(const body::BodyTemplate& body) {
  BonesOfRoles bones;
  for (size_t b = 0; b < body.bone_names.size(); ++b) bones[body.bone_roles[b]].push_back(body.bone_names[b]);
  return bones;
}

double HeightOf(const body::BodyTemplate& body) {
  return static_cast<double>(body.vertices.row(2).maxCoeff() - body.vertices.row(2).minCoeff());
}

std::string TableOf(const body::BodyTemplate& body, const BonesOfRoles& bones) {
  std::string text = Format("vertices          %d\nfaces             %d\nheight            %.2f m\nbones             %zu\n",
                            static_cast<int>(body.vertices.cols()), static_cast<int>(body.faces.cols()), HeightOf(body),
                            body.bone_names.size());
  for (const auto& [role, names] : bones) {
    const std::string word(ToString(role));
    if (role != body::BoneRole::kOther) text += Format("  %-15s %s\n", word.c_str(), Join(names, ", ").c_str());
  }
  const size_t others = bones.count(body::BoneRole::kOther) ? bones.at(body::BoneRole::kOther).size() : 0;
  return text + Format("  %-15s %zu, which follow their parents\nshapes            %zu\npose directions   %d\n", "other",
                       others, body.shapes.names.size(), static_cast<int>(body.pose_directions.cols()));
}

}  // namespace

CommandResult Describe(const BodyTemplateReport& report) {
  const body::BodyTemplate& body = report.body;
  const BonesOfRoles bones = BonesByRole(body);
  CommandResult result;
  result.inputs = report.inputs;
  result.metrics = {{"vertices", body.vertices.cols()},
                    {"faces", body.faces.cols()},
                    {"height_m", static_cast<float>(HeightOf(body))},
                    {"bones", body.bone_names.size()},
                    {"roles", nlohmann::ordered_json::object()},
                    {"shapes", body.shapes.names},
                    {"pose_directions", body.pose_directions.cols()}};
  for (const auto& [role, names] : bones) result.metrics["roles"][std::string(ToString(role))] = names;
  result.text = TableOf(body, bones);
  if (!report.options.out.empty()) result.outputs.push_back({report.options.out, "body-template"});
  return result;
}

}  // namespace mvstudio::stages
