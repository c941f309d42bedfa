#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <set>

#include "core/error.h"
#include "core/files.h"
#include "dataset/image_io.h"
#include "dataset/verify_internal.h"

namespace mvstudio::dataset::internal {
namespace fs = std::filesystem;
namespace {

std::string FrameName(const std::string& camera, int frame) {
  char number[16];
  std::snprintf(number, sizeof(number), "_%08d", frame);
  return camera + number;
}

std::string SizeText(int width, int height) { return std::to_string(width) + "x" + std::to_string(height); }

/// "frame 12" or "3 frames: 12, 15, 19" (at most five are named).
std::string FramesText(const std::vector<int>& frames) {
  std::string text = std::to_string(frames.size()) + (frames.size() == 1 ? " frame: " : " frames: ");
  for (size_t i = 0; i < std::min<size_t>(frames.size(), 5); ++i) text += (i ? ", " : "") + std::to_string(frames[i]);
  return text + (frames.size() > 5 ? ", …" : "");
}

/// Files of a camera's folder, and findings about those whose name is not `00_00_%08d.ext`.
std::set<std::string> ListNames(const std::string& folder, const std::string& camera, Findings* findings) {
  std::set<std::string> names;
  int strange = 0;
  std::string first;
  for (const std::string& path : Glob(folder)) {
    const fs::path file(path);
    const std::string stem = file.stem().string(), extension = file.extension().string();
    const bool good = stem.size() == camera.size() + 9 && stem.compare(0, camera.size() + 1, camera + "_") == 0 &&
                      stem.find_first_not_of("0123456789", camera.size() + 1) == std::string::npos &&
                      (extension == ".jpg" || extension == ".png");
    if (good) names.insert(stem);
    if (!good && ++strange == 1) first = path;
  }
  if (strange > 0) {
    findings->Warning("DAT-NAME", first,
                      "is not named " + camera + "_%08d.jpg or .png and is not read" +
                          (strange > 1 ? "; " + std::to_string(strange - 1) + " more" : ""));
  }
  return names;
}

/// Pixels in the image of the valid joints.
struct ProjectedJoints {
  std::vector<Eigen::Vector2d> px;
  int valid = 0;
};

ProjectedJoints ProjectJoints(const Body3dScene& scene, const geometry::RigCamera& camera,
                              const geometry::Projector& projector) {
  ProjectedJoints out;
  for (const auto& [id, pose] : scene.people) {
    for (int j = 0; j < 19; ++j) {
      if (!pose.valid[j]) continue;
      ++out.valid;
      const auto projection = projector.Project(camera.cam_from_world * Eigen::Vector3d(pose.x_in_world.col(j)));
      if (projection.status == Status::kOk && InImage(camera.camera, projection.px)) out.px.push_back(projection.px);
    }
  }
  return out;
}

struct MaskCheck {
  bool binary = true, empty = true;
};

MaskCheck CheckMask(const Image& mask) {
  MaskCheck check;
  for (const uint8_t p : mask.pixels) {
    check.binary &= p == 0 || p == 255;
    check.empty &= p == 0;
  }
  return check;
}

/// State of one camera's check.
struct Checker {
  const std::string& root;
  const geometry::RigCamera& camera;
  Findings* findings;
  geometry::Projector projector;
  PictureCounts counts;
  int valid = 0, in_image = 0, on_mask = 0, on_some_mask = 0;
  std::vector<int> empty_masks;
  std::set<std::string> told;

  const std::string& name() const { return camera.camera.name; }

  /// Reports the same kind of fault once a camera.
  void Once(const std::string& code, const std::string& path, const std::string& text) {
    if (told.insert(code).second) findings->Error(code, path, text + " (further ones of this camera are not listed)");
  }

  void Size(const Image& image, const std::string& path, const char* code) {
    if (image.width == camera.camera.width_px && image.height == camera.camera.height_px) return;
    Once(code, path,
         "is " + SizeText(image.width, image.height) + ", the calibration says " +
             SizeText(camera.camera.width_px, camera.camera.height_px));
  }

  void Picture(const std::string& path) {
    try {
      Size(ReadImage(path), path, "DAT-SIZE");
      ++counts.pictures;
    } catch (const FormatError& error) {
      findings->Error("DAT-IMAGE", path, std::string(error.what()).substr(path.size() + 2));
    }
  }

  void Mask(const std::string& path, int frame, const ProjectedJoints& joints) {
    Image mask;
    try {
      mask = ReadImage(path, true);
    } catch (const FormatError& error) {
      findings->Error("DAT-MASK", path, std::string(error.what()).substr(path.size() + 2));
      return;
    }
    ++counts.masks;
    Size(mask, path, "DAT-MASK-SIZE");
    if (mask.width != camera.camera.width_px || mask.height != camera.camera.height_px) return;
    const MaskCheck check = CheckMask(mask);
    if (!check.binary) Once("DAT-MASK-BINARY", path, "holds values other than 0 and 255");
    if (check.empty && !joints.px.empty()) empty_masks.push_back(frame);
    for (const Eigen::Vector2d& px : joints.px) {
      const int x = std::clamp(int(std::lround(px.x())), 0, mask.width - 1),
                y = std::clamp(int(std::lround(px.y())), 0, mask.height - 1);
      ++on_some_mask;
      on_mask += *mask.Pixel(x, y) > 127;
    }
  }
};

void Missing(const std::string& code, const std::string& folder, const char* what, const std::vector<int>& frames,
             Findings* findings) {
  if (!frames.empty()) findings->Error(code, folder, std::string("no ") + what + " for " + FramesText(frames));
}

void Summarise(const Checker& c, const std::string& images, const std::string& masks, const VerifyOptions& options) {
  if (c.valid > 0 && c.in_image == 0) {
    c.findings->Warning("DAT-VIEW", images, "no joint of any frame projects into this camera's pictures");
  }
  if (!c.empty_masks.empty())
    c.findings->Warning("DAT-MASK-EMPTY", masks, "the mask is empty though joints are in view in " + FramesText(c.empty_masks));
  if (c.on_some_mask > 0 && c.on_mask < options.least_cover * c.on_some_mask) {
    c.findings->Warning("DAT-COVER", masks,
                        "only " + std::to_string(100 * c.on_mask / c.on_some_mask) +
                            " % of the joints in view lie on the masks: wrong camera, wrong frame numbers or poor masks");
  }
}

}  // namespace

PictureCounts VerifyPictures(const std::string& root, const geometry::RigCamera& camera,
                             const std::map<int, Body3dScene>& scenes, const VerifyOptions& options, Findings* findings) {
  const std::string images = root + "/hdImgs/" + camera.camera.name, masks = root + "/masks/" + camera.camera.name;
  Checker checker{root, camera, findings, geometry::Projector(camera.camera), {}, 0, 0, 0, 0, {}, {}};
  const std::set<std::string> image_names = ListNames(images, camera.camera.name, findings);
  const bool any_masks = fs::is_directory(root + "/masks");
  const std::set<std::string> mask_names =
      fs::is_directory(masks) ? ListNames(masks, camera.camera.name, findings) : std::set<std::string>{};
  std::vector<int> no_image, no_mask;
  int position = 0;
  for (const auto& [frame, scene] : scenes) {
    const std::string name = FrameName(camera.camera.name, frame);
    const ProjectedJoints joints = ProjectJoints(scene, camera, checker.projector);
    checker.valid += joints.valid;
    checker.in_image += static_cast<int>(joints.px.size());
    const bool decode = position++ % options.picture_step == 0;
    if (!image_names.count(name)) {
      no_image.push_back(frame);
    } else if (decode) {
      const std::string stem = images + "/" + name;
      checker.Picture(fs::exists(stem + ".jpg") ? stem + ".jpg" : stem + ".png");
    }
    if (any_masks && !mask_names.count(name)) no_mask.push_back(frame);
    if (mask_names.count(name) && decode) checker.Mask(masks + "/" + name + ".png", frame, joints);
  }
  Missing("DAT-IMAGE-MISSING", images, "picture", no_image, findings);
  Missing("DAT-MASK-MISSING", masks, "mask", no_mask, findings);
  const size_t extra = image_names.size() - std::min(image_names.size(), scenes.size() - no_image.size());
  if (extra > 0) findings->Warning("DAT-POSE-MISSING", images, std::to_string(extra) + " pictures have no body3DScene file");
  Summarise(checker, images, masks, options);
  return checker.counts;
}

}  // namespace mvstudio::dataset::internal
