#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "calib/formats/formats.h"
#include "dataset/exports/joint_files.h"
#include "geometry/skeleton/skeleton.h"

/// EasyMocap's folders: intri.yml, extri.yml, images/CAM/%06d, mask/CAM/%06d.png (also masks/, which EasyVolcap and 4K4D
/// open first), annots/CAM/%06d.json, keypoints3d/%06d.json;
/// joints in the order of BODY_25, c = 0 where there is none.
namespace mvstudio::exports {
namespace {

using Json = nlohmann::ordered_json;

/// For each joint of BODY_25 the one of Panoptic's 19, or -1.
std::vector<int> Body25FromCoco19() {
  std::vector<int> from;
  for (const std::string& joint : geometry::SkeletonByName("body25").joints) from.push_back(geometry::Coco19().Find(joint));
  return from;
}

Json Keypoints3d(const People& people) {
  Json list = Json::array();
  for (const auto& [id, pose] : people) {
    Json joints = Json::array();
    for (const int j : Body25FromCoco19()) {
      if (j < 0 || !pose.valid[j]) {
        joints.push_back({0.0, 0.0, 0.0, 0.0});
      } else {
        const Eigen::Vector3d x = pose.x_in_world.col(j);
        joints.push_back({x.x(), x.y(), x.z(), pose.confidence[j]});
      }
    }
    list.push_back({{"id", id}, {"keypoints3d", joints}});
  }
  return list;
}

/// A person's joints as the camera sees them, with their bounding box.
Json Annotation(const View& view, const geometry::Projector& projector, int id, const dataset::Coco19Pose& pose) {
  Json keypoints = Json::array();
  Eigen::AlignedBox2d box;
  for (const int j : Body25FromCoco19()) {
    geometry::Projection seen;
    seen.status = Status::kTooFewViews;
    if (j >= 0 && pose.valid[j]) seen = projector.Project(view.camera.cam_from_world * Eigen::Vector3d(pose.x_in_world.col(j)));
    if (seen.status != Status::kOk || !InImage(view.camera.camera, seen.px)) {
      keypoints.push_back({0.0, 0.0, 0.0});
      continue;
    }
    keypoints.push_back({seen.px.x(), seen.px.y(), pose.confidence[j]});
    box.extend(seen.px);
  }
  Json corners = {0.0, 0.0, 0.0, 0.0, 0.0};
  if (!box.isEmpty()) corners = {box.min().x(), box.min().y(), box.max().x(), box.max().y(), 1.0};
  return {{"personID", id}, {"bbox", corners}, {"keypoints", keypoints}, {"isKeyframe", false}};
}

Json Annotations(const View& view, const People& people, const std::string& file) {
  const geometry::Projector projector(view.camera.camera);
  Json annots = Json::array();
  for (const auto& [id, pose] : people) annots.push_back(Annotation(view, projector, id, pose));
  return {{"filename", file},
          {"height", view.camera.camera.height_px},
          {"width", view.camera.camera.width_px},
          {"annots", annots},
          {"isKeyframe", false}};
}

/// EasyVolcap takes the images to be 0, 1, 2, … where there is one numbered 0; else it takes them in the order of their names.
void NoteGaps(const Job& job) {
  const std::vector<int>& frames = job.take.frames;
  if (frames.empty() || frames.front() != 0 || frames.back() == static_cast<int>(frames.size()) - 1) return;
  job.report->notes.push_back({"EXP-GAPS",
                               "the frames begin with 0 and have gaps; EasyVolcap and 4K4D then look for 000001, 000002, …",
                               "leave out frame 0 with option 'frames', and they take the files in their order"});
}

}  // namespace

void WriteEasyMocap(const Job& job) {
  NoteGaps(job);
  const Take& take = job.take;
  NoteJointsBeside(job);
  calib::WriteCalibration(RigOf(take, AllViews(take)), calib::CalibrationFormat::kEasyMocap, job.folder);
  job.report->files.insert(job.report->files.end(), {"intri.yml", "extri.yml"});
  for (const int frame : take.frames) {
    job.Write(Numbered("keypoints3d/", frame, 6, ".json"), Keypoints3d(take.At(frame)).dump(1) + "\n");
    for (size_t i = 0; i < take.views.size(); ++i) {
      const std::string stem = Numbered(take.views[i].info.name + "/", frame, 6, "");
      const std::string file = job.images.AddImage(i, frame, "images/" + stem);
      if (job.images.AddMask(i, frame, "mask/" + stem + ".png")) job.images.AlsoTo("masks/" + stem + ".png");
      const Json annots = Annotations(take.views[i], take.At(frame), file.empty() ? "images/" + stem + ".jpg" : file);
      job.Write("annots/" + stem + ".json", annots.dump() + "\n");
    }
  }
}

}  // namespace mvstudio::exports
