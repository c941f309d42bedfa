#include "avatar/body/makehuman/read.h"

#include <array>
#include <filesystem>

#include "avatar/body/makehuman/obj.h"
#include "avatar/body/makehuman/rig.h"
#include "avatar/body/makehuman/roles.h"
#include "avatar/body/makehuman/target.h"
#include "avatar/body/rig_rules.h"
#include "avatar/body/role_bones.h"
#include "avatar/body/template_atlas.h"
#include "core/disk/files.h"
#include "core/disk/paths.h"
#include "core/error.h"

namespace mvstudio::body {
namespace {

constexpr size_t kMaxTargetBytes = 64 << 20;

/// Decimetres, y up, the person faces z -> body.
Eigen::Matrix3Xd ToBody(const Eigen::Matrix3Xd& x) {
  Eigen::Matrix3Xd rotated(3, x.cols());
  rotated.row(0) = 0.1 * x.row(0);
  rotated.row(1) = -0.1 * x.row(2);
  rotated.row(2) = 0.1 * x.row(1);
  return rotated;
}

struct Targets {
  std::vector<std::string> names;
  std::vector<Eigen::Matrix3Xd> moved;  // (3, N) metres in body
};

Targets ReadTargets(const std::string& folder, int num_vertices) {
  constexpr size_t kMostTargets = 1000;
  Targets targets;
  const std::string suffix = ".target.gz";
  for (const std::string& path : FilesNamed(folder + "/targets", "", suffix)) {
    const std::string text = Gunzip(ReadFile(path), path, kMaxTargetBytes), file = std::filesystem::path(path).filename();
    const Eigen::Matrix3Xd moved = ToBody(ParseTarget(text, path, num_vertices));
    if (moved.isZero(0)) continue;
    if (targets.names.size() >= kMostTargets) throw FormatError(folder, "targets", "are more than can be read");
    targets.names.push_back(file.substr(0, file.size() - suffix.size()));
    targets.moved.push_back(moved);
  }
  return targets;
}

/// How much of a target the mean body has: equal parts of all that give ethnicity and gender.
std::vector<double> MeanShares(const Targets& targets) {
  std::vector<double> shares(targets.names.size(), 0.0);
  int count = 0;
  const auto is_part = [](const std::string& name) {
    for (const char* ethnicity : {"african-", "asian-", "caucasian-"}) {
      if (name.rfind(ethnicity, 0) == 0) return true;
    }
    return false;
  };
  for (const std::string& name : targets.names) count += is_part(name);
  for (size_t i = 0; i < shares.size(); ++i) {
    if (is_part(targets.names[i])) shares[i] = 1.0 / count;
  }
  return shares;
}

/// A face as triangles, a quadrangle along its shorter diagonal.
void AddTriangles(const std::vector<int>& face, const Eigen::Matrix3Xd& x, std::vector<std::array<int, 3>>* triangles) {
  if (face.size() == 3) {
    triangles->push_back({face[0], face[1], face[2]});
  } else if ((x.col(face[0]) - x.col(face[2])).norm() <= (x.col(face[1]) - x.col(face[3])).norm()) {
    triangles->push_back({face[0], face[1], face[2]});
    triangles->push_back({face[0], face[2], face[3]});
  } else {
    triangles->push_back({face[0], face[1], face[3]});
    triangles->push_back({face[1], face[2], face[3]});
  }
}

/// Keeps the group's vertices `kept` of all.
void SetMesh(const ObjMesh& mesh, const std::vector<int>& kept, const Eigen::Matrix3Xd& x, BodyTemplate* body) {
  std::vector<int> place(static_cast<size_t>(x.cols()), -1);
  body->vertices.resize(3, static_cast<Eigen::Index>(kept.size()));
  for (size_t i = 0; i < kept.size(); ++i) {
    place[kept[i]] = static_cast<int>(i);
    body->vertices.col(static_cast<Eigen::Index>(i)) = x.col(kept[i]).cast<float>();
  }
  std::vector<std::array<int, 3>> triangles;
  for (const std::vector<int>& face : mesh.faces.at("body")) AddTriangles(face, x, &triangles);
  body->faces.resize(3, static_cast<Eigen::Index>(triangles.size()));
  for (size_t f = 0; f < triangles.size(); ++f) {
    for (int k = 0; k < 3; ++k) body->faces(k, static_cast<Eigen::Index>(f)) = place[triangles[f][k]];
  }
}

RigRules SetBones(const MakeHumanRig& rig, const std::string& path, BodyTemplate* body) {
  RigRules rules;
  for (const MakeHumanRig::Bone& bone : rig.bones) {
    body->bone_names.push_back(bone.name);
    body->bone_parents.push_back(bone.parent);
    body->bone_roles.push_back(RoleOfMakeHumanBone(bone.name));
    rules.heads.push_back(bone.head);
    rules.tails.push_back(bone.tail);
  }
  try {
    FindRoleBones(*body);
  } catch (const ContractViolation& error) {
    throw FormatError(path, "bones", error.what());
  }
  return rules;
}

/// Neck, nose, eyes and ears are ends of bones of the rig of OpenPose's joints.
void SetFaceJoints(const MakeHumanRig& openpose, const std::string& path, RigRules* rules) {
  static constexpr std::pair<int, const char*> kTails[] = {{0, "MidHip"}, {1, "Neck"},  {15, "LEye"},
                                                           {16, "LEar"},  {17, "REye"}, {18, "REar"}};
  for (const auto& [joint, name] : kTails) {
    const int bone = openpose.Find(name);
    if (bone < 0) throw FormatError(path, "bones." + std::string(name), "is missing");
    rules->coco19[joint] = openpose.bones[bone].tail;
  }
}

/// `all` has the displacements of all vertices by each shape (3N, S); those of the kept ones go into the template.
void SetShapes(const Targets& targets, const std::vector<double>& shares, const std::vector<int>& kept,
               const Eigen::MatrixXf& all, BodyTemplate* body) {
  constexpr double kSigma = 0.25;  // no statistic of a population: a quarter of what the modellers made the extreme
  BlendShapes& shapes = body->shapes;
  shapes.names = targets.names;
  shapes.vertices.resize(3 * static_cast<Eigen::Index>(kept.size()), all.cols());
  for (size_t i = 0; i < kept.size(); ++i)
    shapes.vertices.middleRows<3>(3 * static_cast<Eigen::Index>(i)) = all.middleRows<3>(3 * static_cast<Eigen::Index>(kept[i]));
  const Eigen::Index count = all.cols();
  shapes.low.resize(count);
  shapes.high.resize(count);
  for (Eigen::Index s = 0; s < count; ++s) {
    shapes.low[s] = -shares[static_cast<size_t>(s)];
    shapes.high[s] = 1 - shares[static_cast<size_t>(s)];
  }
  shapes.sigma.setConstant(count, kSigma);
}

}  // namespace

BodyTemplate ReadMakeHuman(const std::string& folder, const std::string& rig_name) {
  const auto path = [&folder](const std::string& file) { return folder + "/" + file; };
  const auto text = [&path](const std::string& file) { return ReadFile(path(file)); };
  const ObjMesh mesh = ParseObj(text("base.obj"), path("base.obj"));
  const std::vector<int> kept = GroupVertices(mesh, "body", path("base.obj"));
  const int num_vertices = static_cast<int>(mesh.vertices.cols());
  const std::string rig_file = "rig." + rig_name + ".json", weight_file = "weights." + rig_name + ".json";
  const MakeHumanRig rig = ParseRig(text(rig_file), path(rig_file), mesh);
  const MakeHumanRig openpose = ParseRig(text("rig.openpose.json"), path("rig.openpose.json"), mesh);
  const Targets targets = ReadTargets(folder, num_vertices);
  const std::vector<double> shares = MeanShares(targets);

  Eigen::Matrix3Xd x = ToBody(mesh.vertices);
  Eigen::MatrixXf moved(3 * num_vertices, static_cast<Eigen::Index>(targets.names.size()));
  for (size_t s = 0; s < shares.size(); ++s) {
    x += shares[s] * targets.moved[s];
    moved.col(static_cast<Eigen::Index>(s)) = targets.moved[s].reshaped().cast<float>();
  }
  double sole = x(2, kept.front());
  for (const int v : kept) sole = std::min(sole, x(2, v));
  x.row(2).array() -= sole;

  BodyTemplate body;
  SetMesh(mesh, kept, x, &body);
  RigRules rules = SetBones(rig, path(rig_file), &body);
  SetFaceJoints(openpose, path("rig.openpose.json"), &rules);
  CompleteRules(body, &rules);
  PlaceRig(rules, x, moved, &body);
  SetShapes(targets, shares, kept, moved, &body);
  const auto weights = ParseRigWeights(text(weight_file), path(weight_file), rig, num_vertices);
  std::vector<std::vector<std::pair<int, double>>> kept_weights;
  for (const int v : kept) kept_weights.push_back(weights[static_cast<size_t>(v)]);
  SetSkin(std::move(kept_weights), &body);
  BuildTemplateAtlas(&body);
  return body;
}

}  // namespace mvstudio::body
