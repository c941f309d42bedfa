#include "dataset/build/footage_check.h"

#include <filesystem>
#include <set>

#include "core/format.h"
#include "dataset/panoptic/exchanged.h"
#include "dataset/verify/image_mask.h"

namespace mvstudio::dataset::internal {
namespace {

void WarnOfWeakMasks(const BuiltCamera& c, std::vector<Notice>* warnings) {
  constexpr double kLeast = 0.8;
  if (c.joints == 0 || c.joints_supported >= kLeast * c.joints) return;
  warnings->push_back({"DAT-MASK",
                       "camera " + c.alias + ": only " + std::to_string(100 * c.joints_supported / c.joints) +
                           " % of the joints lie where the image shows a person by its colours",
                       "look at the masks; check the calibration and the time offset of this camera, or give a clean plate"});
}

/// Masks of other programs against joints and images: of another camera or time, mirrored, inverted, empty, of all ones.
void WarnOfGivenMasks(const std::string& masks, const std::vector<CameraResult>& results, const std::map<int, People>& poses,
                      const std::string& folder, const std::set<std::string>& but, const RunContext& run,
                      std::vector<Notice>* warnings) {
  PanopticDataset data;
  data.root = folder, data.poses = poses;
  CameraFrames frames;
  std::map<std::string, std::string> aliases;
  for (const CameraResult& r : results) {
    if (r.built.images == 0 || but.count(r.built.name) > 0) continue;
    data.rig.cameras.push_back(r.camera), aliases[r.built.name] = r.built.alias;
    for (const auto& [step, people] : poses) frames[r.built.name].push_back(step);
  }
  MaskMeaning written;  // 0 to 255, whatever was given
  written.form = MaskMeaning::Form::kSoft;
  std::vector<Finding> found = CompareJointsWithMasks(data, written, frames, run);
  if (!std::filesystem::exists(masks + "/mask.result.json")) {  // `mvstudio mask` made its own of these images
    for (Finding& finding : CompareImagesWithMasks(data, written, frames, run)) found.push_back(std::move(finding));
  }
  for (const Finding& finding : found) {
    std::string text = "camera " + std::filesystem::path(finding.path).filename().string() + ": " + finding.text;
    for (const auto& [name, alias] : aliases) {
      for (size_t at = text.find(name); at != std::string::npos; at = text.find(name, at + alias.size()))
        text.replace(at, name.size(), alias);
    }
    warnings->push_back({finding.code, text,
                         "give the masks of this camera and these frames (option 'first-mask' says where their numbers begin), "
                         "255 the person"});
  }
}

}  // namespace

void WarnOfFootage(const std::vector<CameraResult>& results, const std::map<int, People>& poses, const std::string& folder,
                   const BuildOptions& options, const std::string& masks, const RunContext& run,
                   std::vector<Notice>* warnings) {
  geometry::Rig rig;
  std::map<std::string, std::string> aliases;
  for (const CameraResult& r : results) rig.cameras.push_back(r.camera), aliases[r.built.name] = r.built.alias;
  const auto image = [&](const std::string& camera, int frame) {
    return folder + "/hdImgs/" + camera + "/" + camera + Format("_%08d", frame) + (options.png ? ".png" : ".jpg");
  };
  std::set<std::string> named;
  for (const ExchangedCameras& found : FindExchanged(rig, poses, image, run)) {
    named.insert({found.a, found.b});
    const std::string a = aliases[found.a], b = aliases[found.b];
    warnings->push_back(
        {"DAT-EXCHANGED", found.Text(a, b),
         "give each its own footage (option 'video' " + a + "=FILE, or the files of the session) and build again"});
  }
  if (options.masks && !masks.empty()) WarnOfGivenMasks(masks, results, poses, folder, named, run, warnings);
  for (const CameraResult& r : results) {
    if (options.masks && masks.empty() && named.count(r.built.name) == 0) WarnOfWeakMasks(r.built, warnings);
  }
}

}  // namespace mvstudio::dataset::internal
