#include "synth/read_body.h"

#include <filesystem>

#include "avatar/body/files/person_file.h"
#include "avatar/body/files/textured_person.h"
#include "avatar/body/role_bones.h"
#include "avatar/body/templates/read.h"
#include "core/error.h"
#include "dataset/arrays/npz.h"

namespace mvstudio::synth {
namespace {

bool IsPersonFile(const std::string& path) {
  return std::filesystem::is_regular_file(path) && std::filesystem::path(path).extension() == ".npz" &&
         dataset::ReadNpzMembers(path).count("schema") > 0;
}

GivenBody FromPersonFile(const std::string& path) {
  body::PersonFile file = body::ReadPersonFile(path);
  try {
    body::FindRoleBones(file.body);
  } catch (const ContractViolation&) {
    throw FormatError(path, "bone_roles", "lacks bones of trunk, head or limbs, or has one twice; no motion fits this body");
  }
  GivenBody given{std::move(file.body), {}};
  if (file.extras.count("textures")) given.textures = body::ReadPerson(path).textures;
  return given;
}

}  // namespace

GivenBody ReadBody(const std::string& path) {
  if (!std::filesystem::exists(path))
    throw IoError(path,
                  "does not exist; expected a fitted body.npz, MakeHuman's folder, or a .npz or .pkl file in SMPL's layout");
  if (IsPersonFile(path)) return FromPersonFile(path);
  return {body::ReadTemplate(path), {}};
}

}  // namespace mvstudio::synth
