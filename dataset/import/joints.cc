#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "dataset/import/import_steps.h"
#include "dataset/panoptic/panoptic.h"

namespace mvstudio::dataset::internal {
namespace {

/// The value whose confidence, as ToCoco19 defines it, is the file's.
double SigmaOfConfidence(double confidence) {
  constexpr double kScaleM = 0.05, kLeast = 1e-12;
  return std::max(0.0, -kScaleM * std::log(std::max(confidence, kLeast)));
}

std::vector<JointRow> RowsOf(int frame, const std::map<int, Coco19Pose>& people) {
  std::vector<JointRow> rows;
  for (const auto& [id, pose] : people) {
    for (int j = 0; j < 19; ++j) {
      JointRow row;
      row.frame = frame;
      row.person = id;
      row.joint = geometry::Coco19().joints[static_cast<size_t>(j)];
      if (pose.valid[j]) {
        row.status = Status::kOk;
        row.x_in_world = pose.x_in_world.col(j);
        row.sigma_m = SigmaOfConfidence(pose.confidence[j]);
      }
      rows.push_back(std::move(row));
    }
  }
  return rows;
}

/// Joints, a file at a time; returns the times that the files state.
class JointImport {
 public:
  JointImport(ImportJob* job, const PanopticFrames& scenes, const std::string& take, PanopticImportReport* report)
      : job_(job), scenes_(scenes), take_(take), report_(report) {}

  std::map<int, double> Run() {
    auto next = scenes_.files.begin();
    const auto end = scenes_.files.end();
    ProgressStage stage(job_->run, "joints", static_cast<int64_t>(scenes_.files.size()));
    const auto rows_of_next = [&](std::vector<JointRow>* rows) {
      rows->clear();
      for (; next != end && rows->empty(); ++next) {
        if (job_->range.Has(next->first)) *rows = Read(next->first, next->second);
        stage.Advance();
      }
      return !rows->empty();
    };
    WritePose3d({"coco19", {}}, rows_of_next, job_->work + "/pose3d/" + take_);
    if (other_skeletons_ > 0) {
      job_->findings.Error("DAT-POSE", scenes_.folder,
                           std::to_string(other_skeletons_) + " files hold another skeleton than joints19 and are left out");
    }
    return std::move(times_);
  }

 private:
  std::vector<JointRow> Read(int frame, const std::string& path) {
    try {
      const PanopticScene scene = ReadPanopticScene(path);
      if (scene.univ_time_ms.value_or(-1) >= 0) times_[frame] = *scene.univ_time_ms;
      const bool other = std::any_of(scene.bodies.begin(), scene.bodies.end(),
                                     [](const PanopticBody& b) { return b.id >= 0 && b.joints19.empty(); });
      if (other) return ++other_skeletons_, std::vector<JointRow>();
      const auto people = ToCoco19(scene, path);
      Count(frame, people);
      return RowsOf(frame, people);
    } catch (const FormatError& error) {
      job_->findings.Error("DAT-POSE", path, WithoutPath(error));
    } catch (const IoError& error) {
      job_->findings.Error("DAT-POSE", path, error.what());
    }
    return {};
  }

  void Count(int frame, const std::map<int, Coco19Pose>& people) {
    if (report_->frames++ == 0) report_->first_frame = frame;
    report_->last_frame = frame;
    report_->most_people = std::max(report_->most_people, static_cast<int>(people.size()));
    for (const auto& [id, pose] : people) report_->joints += std::count(pose.valid.begin(), pose.valid.end(), true);
  }

  ImportJob* job_;
  const PanopticFrames& scenes_;
  const std::string& take_;
  PanopticImportReport* report_;
  std::map<int, double> times_;
  int other_skeletons_ = 0;
};

}  // namespace

std::map<int, double> ImportJoints(ImportJob* job, const PanopticFrames& scenes, const std::string& take,
                                   PanopticImportReport* report) {
  return JointImport(job, scenes, take, report).Run();
}

}  // namespace mvstudio::dataset::internal
