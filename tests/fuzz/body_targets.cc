#include "avatar/body/files/gltf.h"
#include "avatar/body/files/obj_sequence.h"
#include "avatar/body/files/person_file.h"
#include "core/disk/npy_write.h"
#include "dataset/arrays/npz.h"
#include "tests/fuzz/fuzz.h"

/// Archives of arrays, and bodies in them.
namespace mvstudio::fuzz {
namespace {

/// The header of a PNG of this size: as much as writers look at.
std::string PngHeader(int size) {
  std::string png("\x89PNG\r\n\x1a\n\0\0\0\rIHDR", 16);
  for (int k = 0; k < 8; ++k) png += static_cast<char>(size >> (8 * (3 - k % 4)));
  return png + std::string(16, '\0');
}

}  // namespace

MVS_FUZZ_TARGET(npz, bytes) {
  std::map<std::string, std::string> members;
  if (!Accepts([&] { members = dataset::ParseNpzMembers(std::string(bytes), "a.npz", 1 << 24); })) return;
  size_t total = 0;
  for (const auto& member : members) total += member.second.size();
  Require(total <= 1 << 24, "more bytes than the limit");
  Accepts([&] { dataset::ParseNpz(std::string(bytes), "a.npz"); });
  std::map<std::string, std::string> back;
  const std::string again = NpzOf({members.begin(), members.end()});
  Require(Accepts([&] { back = dataset::ParseNpzMembers(again, "b.npz"); }) || members.empty(),
          "what was written cannot be read");
  Require(back == members, "a member changes when it is written and read");
}

/// The arrays of a body in the order below, as parts: a checksum of the archive would stop every mutation.
MVS_FUZZ_TARGET(body_npz, bytes) {
  const char* names[] = {"schema",     "vertices",     "faces",        "face_part",   "face_uv",
                         "bone_names", "bone_roles",   "bone_parents", "bone_heads",  "bone_tails",
                         "skin_bones", "skin_weights", "coco19",       "coco19_bone", "extra.a"};
  std::vector<std::pair<std::string, std::string>> members;
  for (const std::string_view part : Parts(bytes, std::size(names))) members.emplace_back(names[members.size()], part);
  if (members.back().second.empty()) members.pop_back();
  body::PersonFile person;
  if (!Accepts([&] { person = body::ParsePersonFile(NpzOf(members), "body.npz"); })) return;
  std::string written, again;
  Require(Accepts([&] { written = body::PersonFileBytes(person); }), "what was read cannot be written");
  Require(Accepts([&] { again = body::PersonFileBytes(body::ParsePersonFile(written, "b.npz")); }), "nor read again");
  Require(written == again, "a body changes when it is written and read");
  const body::AtlasPng atlas{PngHeader(body::AtlasSizePx(8)), 8};
  Require(Accepts([&] { body::GlbOfBody(person.body, atlas, {}, 30); }), "a body that glTF does not take");
  Require(Accepts([&] { body::ObjOfBody(person.body, person.body.vertices, 8, "a.mtl"); }), "a body that OBJ does not take");
}

}  // namespace mvstudio::fuzz
