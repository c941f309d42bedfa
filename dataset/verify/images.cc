#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>

#include "core/disk/paths.h"
#include "core/error.h"
#include "core/format.h"
#include "dataset/footage/image_io.h"
#include "dataset/verify/findings.h"
#include "dataset/verify/verify_steps.h"

namespace mvstudio::dataset::internal {
namespace fs = std::filesystem;
namespace {

std::string FrameName(const std::string& camera, int frame) { return camera + Format("_%08d", frame); }

std::string SizeText(int width, int height) { return std::to_string(width) + "x" + std::to_string(height); }

/// Masks of a camera's folder, and findings about those whose name is not `00_00_%08d.png`.
std::set<std::string> ListMasks(const std::string& folder, const std::string& camera, Findings* findings) {
  std::set<std::string> names;
  int strange = 0;
  std::string first;
  for (const std::string& path : FilesIn(folder)) {
    const fs::path file(path);
    const std::string stem = file.stem().string();
    const bool good = stem.size() == camera.size() + 9 && stem.compare(0, camera.size() + 1, camera + "_") == 0 &&
                      stem.find_first_not_of("0123456789", camera.size() + 1) == std::string::npos &&
                      file.extension() == ".png";
    if (good) names.insert(stem);
    if (!good && ++strange == 1) first = path;
  }
  if (strange > 0) {
    findings->Warning("DAT-NAME", first,
                      "is not named " + camera + "_%08d.png and is not read" +
                          (strange > 1 ? "; " + std::to_string(strange - 1) + " more" : ""));
  }
  return names;
}

/// State of one camera's check.
struct Checker {
  const geometry::RigCamera& camera;
  Findings* findings;
  geometry::Projector projector;
  FootageCheck counts;
  int valid = 0, in_image = 0;
  MaskCover cover = {};
  const std::optional<MaskMeaning>& masks;
  std::vector<int> empty_masks = {};
  std::set<std::string> told = {};

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

  void CheckImage(const std::string& path, int frame, bool keep_thumbnail) {
    try {
      const Image image = ReadImage(path);
      Size(image, path, "DAT-SIZE");
      ++counts.images;
      if (keep_thumbnail) counts.thumbnails[frame] = MakeThumbnail(image);
    } catch (const FormatError& error) {
      findings->Error("DAT-IMAGE", path, WithoutPath(error));
    } catch (const IoError& error) {
      findings->Error("DAT-IMAGE", path, error.what());
    }
  }

  void Mask(const std::string& path, int frame, const ProjectedJoints& joints) {
    Image mask;
    try {
      mask = masks ? ReadMask(path, *masks) : ReadImage(path, true);
    } catch (const FormatError& error) {
      if (error.where() == "values") {
        Once("DAT-MASK-BINARY", path, WithoutPath(error));
      } else {
        findings->Error("DAT-MASK", path, WithoutPath(error));
      }
      return;
    }
    ++counts.masks;
    Size(mask, path, "DAT-MASK-SIZE");
    if (mask.width != camera.camera.width_px || mask.height != camera.camera.height_px) return;
    if (!masks) return;
    const bool empty = std::all_of(mask.pixels.begin(), mask.pixels.end(), [](uint8_t p) { return p == 0; });
    if (empty && !joints.px.empty()) empty_masks.push_back(frame);
    cover.Add(mask, joints);
  }
};

/// A dataset need not hold every image; a camera of which it holds none is of no use.
void Missing(const std::string& code, const std::string& folder, const char* what, const std::vector<int>& frames, size_t asked,
             Findings* findings) {
  if (frames.empty()) return;
  if (frames.size() == asked) {
    findings->Error(code, folder, std::string("no ") + what + " for any of " + std::to_string(asked) + " frames with joints");
  } else {
    findings->Warning(code, folder,
                      std::string("no ") + what + " for " + std::to_string(frames.size()) + " of " + std::to_string(asked) +
                          " frames with joints; " + FramesText(frames));
  }
}

void Summarise(const Checker& c, const std::string& images, const std::string& masks, const VerifyOptions& options) {
  if (c.valid > 0 && c.in_image == 0) {
    c.findings->Warning("DAT-VIEW", images, "no joint of any frame projects into this camera's images");
  }
  if (!c.empty_masks.empty())
    c.findings->Warning("DAT-MASK-EMPTY", masks, "the mask is empty though joints are in view in " + FramesText(c.empty_masks));
  c.cover.Report(masks, options.least_cover, c.findings);
}

/// Every how-many-th frame gives a thumbnail: eight of those that are decoded.
int SampleStep(size_t frames, int image_step) {
  const int decoded = static_cast<int>(frames) / image_step;
  return image_step * std::max(1, decoded / 8);
}

/// Images that no joints belong to: a step's worth is decoded, nothing is missing.
void ImagesAlone(const PanopticFootage& footage, const VerifyOptions& options, Checker* checker) {
  const int sample = SampleStep(footage.images.size(), options.image_step);
  int position = 0;
  for (const auto& [frame, name] : footage.images) {
    if (position % options.image_step == 0) checker->CheckImage(footage.path + "/" + name, frame, position % sample == 0);
    ++position;
  }
}

}  // namespace

ProjectedJoints ProjectJoints(const std::map<int, Coco19Pose>& people, const geometry::RigCamera& camera,
                              const geometry::Projector& projector) {
  ProjectedJoints out;
  for (const auto& [id, pose] : people) {
    for (int j = 0; j < 19; ++j) {
      if (!pose.valid[j]) continue;
      ++out.valid;
      const auto projection = projector.Project(camera.cam_from_world * Eigen::Vector3d(pose.x_in_world.col(j)));
      if (projection.status == Status::kOk && InImage(camera.camera, projection.px)) out.px.push_back(projection.px);
    }
  }
  return out;
}

void MaskCover::Add(const Image& mask, const ProjectedJoints& joints) {
  if (joints.px.empty()) return;
  const int on_mask_before = on_mask;
  for (const Eigen::Vector2d& px : joints.px) {
    const int x = std::clamp(int(std::lround(px.x())), 0, mask.width - 1),
              y = std::clamp(int(std::lround(px.y())), 0, mask.height - 1);
    const int left = mask.width - 1 - x, up = mask.height - 1 - y;
    ++seen;
    on_mask += *mask.Pixel(x, y) > 127, mirrored += *mask.Pixel(left, y) > 127, rotated += *mask.Pixel(left, up) > 127;
  }
  const auto covered = std::count_if(mask.pixels.begin(), mask.pixels.end(), [](uint8_t p) { return p > 127; });
  const double share = static_cast<double>(covered) / static_cast<double>(mask.pixels.size());
  ++masks, empty += covered == 0, whole += share > 0.98, inverted += share > 0.5 && on_mask == on_mask_before;
}

void MaskCover::Report(const std::string& folder, double least_cover, Findings* findings) const {
  if (2 * whole > masks)
    findings->Warning("DAT-COVER", folder,
                      std::to_string(whole) + " of " + std::to_string(masks) +
                          " masks cover the whole image: they tell nobody from the background");
  if (seen == 0 || on_mask >= least_cover * seen) return;
  constexpr double kNearlyAll = 0.9;
  const char* const why = 2 * empty > masks               ? "most masks are empty"
                          : 2 * inverted > masks          ? "the masks are inverted"
                          : mirrored >= kNearlyAll * seen ? "the masks are mirrored left to right"
                          : rotated >= kNearlyAll * seen  ? "the masks are rotated by 180 degrees"
                                                          : "wrong camera, wrong frame numbers or poor masks";
  const std::string text = "only " + std::to_string(100 * on_mask / seen) + " % of the joints in view lie on the masks: " + why;
  2 * on_mask < seen ? findings->Error("DAT-COVER", folder, text) : findings->Warning("DAT-COVER", folder, text);
}

std::optional<MaskMeaning> VerifyMaskValues(const PanopticSequence& sequence, Findings* findings) {
  const std::string folder = sequence.root + "/masks";
  try {
    const MaskMeaning meaning = MaskFolder().Of(folder);
    std::string text = meaning.Text();
    if (meaning.form == MaskMeaning::Form::kSoft && text.empty())
      text = "soft masks: values between 0 and 255 are shares of a pixel";
    if (meaning.form == MaskMeaning::Form::kNobody) text.clear();  // told by camera and frame
    if (!text.empty()) findings->Warning("DAT-MASK-BINARY", folder, text + "; other programs may read them otherwise");
    return meaning;
  } catch (const FormatError& error) {
    findings->Error("DAT-MASK-BINARY", error.path(), WithoutPath(error));
    return std::nullopt;
  }
}

FootageCheck VerifyImages(const PanopticSequence& sequence, const geometry::RigCamera& camera, const PanopticFootage& footage,
                          const std::map<int, Body3dScene>& scenes, const std::optional<MaskMeaning>& mask_values,
                          const VerifyOptions& options, Findings* findings) {
  const std::string& name = camera.camera.name;
  const std::string masks = sequence.root + "/masks/" + name;
  Checker checker{camera, findings, geometry::Projector(camera.camera), {}, 0, 0, {}, mask_values};
  checker.counts.frames = static_cast<int64_t>(footage.images.size());
  if (scenes.empty()) {
    ImagesAlone(footage, options, &checker);
    return checker.counts;
  }
  const bool any_masks = fs::is_directory(sequence.root + "/masks") && name.compare(0, 3, "00_") == 0;
  const std::set<std::string> mask_names = fs::is_directory(masks) ? ListMasks(masks, name, findings) : std::set<std::string>{};
  const int sample = SampleStep(scenes.size(), options.image_step);
  std::vector<int> no_image, no_mask;
  int position = 0;
  for (const auto& [frame, scene] : scenes) {
    const ProjectedJoints joints = ProjectJoints(scene.people, camera, checker.projector);
    checker.valid += joints.valid;
    checker.in_image += static_cast<int>(joints.px.size());
    const bool decode = position % options.image_step == 0, keep = position % sample == 0;
    ++position;
    const auto image = footage.images.find(frame);
    const bool has_image = image != footage.images.end();
    if (!has_image) no_image.push_back(frame);
    if (has_image && decode) checker.CheckImage(footage.path + "/" + image->second, frame, keep);
    const std::string mask = FrameName(name, frame);
    if (any_masks && has_image && !mask_names.count(mask)) no_mask.push_back(frame);
    if (mask_names.count(mask) && decode) checker.Mask(masks + "/" + mask + ".png", frame, joints);
  }
  const size_t with_image = scenes.size() - no_image.size();
  checker.counts.frames += static_cast<int64_t>(no_image.size());
  checker.counts.no_image = static_cast<int>(no_image.size());
  checker.counts.no_mask = static_cast<int>(no_mask.size());
  Missing("DAT-IMAGE-MISSING", footage.path, "image", no_image, scenes.size(), findings);
  Missing("DAT-MASK-MISSING", masks, "mask", no_mask, with_image, findings);
  const size_t extra = footage.images.size() - with_image;
  if (extra > 0)
    findings->Warning("DAT-POSE-MISSING", footage.path, std::to_string(extra) + " images have no body3DScene file");
  Summarise(checker, footage.path, masks, options);
  return checker.counts;
}

}  // namespace mvstudio::dataset::internal
