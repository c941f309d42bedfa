#include "stages/nets/body_folder.h"

#include <filesystem>

#include "avatar/body/files/atlas.h"
#include "avatar/body/files/gltf.h"
#include "core/disk/files.h"
#include "core/disk/manifest.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "dataset/footage/image_io.h"
#include "stages/nets/avatar_fit_image.h"
#include "stages/nets/body_motion.h"

namespace mvstudio::stages {
namespace {

constexpr char kGlbFile[] = "body.glb", kTextureFile[] = "texture.png", kImageFile[] = "surface.png";

}  // namespace

BodyFolder::BodyFolder(const std::string& path, bool overwrite) : path_(path) {
  if (std::filesystem::exists(path + "/" + body::kPersonFileName) && !overwrite)
    throw ResultExistsError(path,
                            "option 'out' " + path + " holds a fitted body: choose another folder, or give option 'overwrite'");
}

std::vector<std::string> BodyFolder::Names() {
  return {body::kPersonFileName, kGlbFile, kTextureFile, kImageFile, kBodyMotionFile, kBodyTextureFile};
}

std::optional<SurfaceLimits> BodyFolder::Write(const body::TexturedPerson& person, double frame_rate_hz) const {
  const std::string texture_path = path_ + "/" + kTextureFile, image_path = path_ + "/" + kImageFile;
  std::optional<SurfaceLimits> surface;
  FilesTogether together;
  WritePerson(person, path_ + "/" + body::kPersonFileName);
  const body::AtlasPng atlas{dataset::EncodeImage(body::AtlasImage(person.textures), kTextureFile), person.textures[0].width};
  body::WriteBodyGlb(path_ + "/" + kGlbFile, person.person.body, atlas, person.person.seen, frame_rate_hz);
  WriteFileAtomic(texture_path, atlas.bytes);
  const std::string motion = BodyMotion(person.person), motion_path = path_ + "/" + kBodyMotionFile;
  const std::string colours = motion.empty() ? "" : BodyTexture(person), colours_path = path_ + "/" + kBodyTextureFile;
  if (!motion.empty()) WriteFileAtomic(motion_path, motion);
  if (!colours.empty()) WriteFileAtomic(colours_path, colours);
  if (person.offset_sigma_m.size() > 0) {
    const SurfaceMaps maps = MapSurface(person);
    WriteFileAtomic(image_path, dataset::EncodeImage(maps.image, image_path));
    surface = SurfaceLimits{maps.offset_limit_mm, maps.sigma_limit_mm};
  }
  together.Commit();
  if (!surface) RemoveOurs({image_path});  // of an older body
  if (motion.empty()) RemoveOurs({motion_path});
  if (colours.empty()) RemoveOurs({colours_path});
  return surface;
}

CommandResult DescribeBodyFolder(const std::string& path, const std::optional<SurfaceLimits>& surface) {
  CommandResult result;
  result.outputs = {{path + "/" + body::kPersonFileName, "body"},
                    {path + "/" + kGlbFile, "body-glb"},
                    {path + "/" + kTextureFile, "texture"}};
  if (std::filesystem::exists(path + "/" + kBodyMotionFile))
    result.outputs.push_back({path + "/" + kBodyMotionFile, "body-motion"});
  if (std::filesystem::exists(path + "/" + kBodyTextureFile))
    result.outputs.push_back({path + "/" + kBodyTextureFile, "body-texture"});
  if (!surface) return result;
  result.outputs.push_back({path + "/" + kImageFile, "surface-maps"});
  result.metrics["surface_maps"] = {{"offset_limit_mm", surface->offset_mm}, {"sigma_limit_mm", surface->sigma_mm}};
  return result;
}

}  // namespace mvstudio::stages
