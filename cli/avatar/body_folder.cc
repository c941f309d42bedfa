#include "cli/avatar/body_folder.h"

#include <filesystem>

#include "avatar/body/files/atlas.h"
#include "avatar/body/files/gltf.h"
#include "core/disk/files.h"
#include "core/disk/manifest.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "dataset/footage/image_io.h"
#include "stages/nets/avatar_fit_picture.h"

namespace mvstudio::cli {
namespace {

constexpr char kGlbFile[] = "body.glb", kTextureFile[] = "texture.png", kPictureFile[] = "surface.png";

}  // namespace

BodyFolder::BodyFolder(const std::string& path, bool overwrite) : path_(path) {
  if (std::filesystem::exists(path + "/" + body::kPersonFileName) && !overwrite)
    throw UsageError("--out " + path + " holds a fitted body: choose another folder, or give --overwrite");
}

std::vector<std::string> BodyFolder::Names() { return {body::kPersonFileName, kGlbFile, kTextureFile, kPictureFile}; }

void BodyFolder::Write(const body::TexturedPerson& person, double frame_rate_hz, stages::CommandResult* result) const {
  const std::string body_path = path_ + "/" + body::kPersonFileName, glb_path = path_ + "/" + kGlbFile,
                    texture_path = path_ + "/" + kTextureFile, picture_path = path_ + "/" + kPictureFile;
  FilesTogether together;
  WritePerson(person, body_path);
  const body::AtlasPng atlas{dataset::EncodeImage(body::AtlasImage(person.textures), kTextureFile), person.textures[0].width};
  body::WriteBodyGlb(glb_path, person.person.body, atlas, person.person.seen, frame_rate_hz);
  WriteFileAtomic(texture_path, atlas.bytes);
  for (const auto& [path, role] : {std::pair(body_path, "body"), {glb_path, "body-glb"}, {texture_path, "texture"}})
    result->outputs.push_back({path, role});
  const bool known = person.offset_sigma_m.size() > 0;
  if (known) {
    const stages::SurfaceMaps maps = stages::MapSurface(person);
    WriteFileAtomic(picture_path, dataset::EncodeImage(maps.picture, picture_path));
    result->outputs.push_back({picture_path, "surface-maps"});
    result->metrics["surface_maps"] = {{"offset_limit_mm", maps.offset_limit_mm}, {"sigma_limit_mm", maps.sigma_limit_mm}};
  }
  together.Commit();
  if (!known) RemoveOurs({picture_path});  // of an older body
}

}  // namespace mvstudio::cli
