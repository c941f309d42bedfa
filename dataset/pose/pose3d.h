#pragma once

#include <Eigen/Core>
#include <array>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/status.h"
#include "geometry/skeleton/skeleton.h"

namespace mvstudio::dataset {

/// One row of points.csv.
struct JointRow {
  int frame = 0;
  int person = 0;
  std::string joint;  ///< OpenPose's name
  Status status = Status::kTooFewViews;
  Eigen::Vector3d x_in_world = Eigen::Vector3d::Zero();  ///< metres; valid only when status is kOk
  int num_views = 0;
  double rms_px = 0;
  double sigma_m = 0;                         ///< sqrt(trace(covariance) / 3)
  std::optional<Eigen::Matrix3d> covariance;  ///< m^2; stored in covariance.csv (frame,person,joint,xx,xy,xz,yy,yz,zz)
};

inline constexpr char kZUpWorld[] = "right-handed, z up";

struct Pose3d {
  std::string skeleton;              ///< name, stored in pose3d.json
  std::vector<JointRow> rows;        ///< sorted by frame, person, joint in skeleton order
  std::string covariance_note = {};  ///< what the covariances include and omit, stored in pose3d.json; empty: not stated
  std::string world = kZUpWorld;     ///< its axes, in words, stored in pose3d.json
  std::optional<geometry::Skeleton> definition = {};  ///< joints, bones, …, stored in pose3d.json; none: as its name says
  double frame_rate_hz = 0;                           ///< time steps a second, stored in pose3d.json; 0: not stated
};

/// Writes `folder/points.csv` with the header frame,person,joint,status,x_m,y_m,z_m,num_views,rms_px,sigma_m; coordinates
/// are empty unless status is Ok. The round trip is exact. False: nothing was written, for an older take is there and this one
/// has no joint at all.
bool WritePose3d(const Pose3d& pose, const std::string& folder);
/// Same for takes larger than memory: `head` has no rows, `next` fills those that follow, false at the end. The files appear
/// when all are written.
bool WritePose3d(const Pose3d& head, const std::function<bool(std::vector<JointRow>*)>& next, const std::string& folder);
Pose3d ReadPose3d(const std::string& folder);
/// The table alone, without skeleton and covariances. Throws IoError, or FormatError with the line.
std::vector<JointRow> ReadPointsCsv(const std::string& path);

/// Panoptic joints of one person in one frame.
struct Coco19Pose {
  Eigen::Matrix<double, 3, 19> x_in_world = Eigen::Matrix<double, 3, 19>::Zero();  ///< metres
  std::array<bool, 19> valid{};
  std::array<double, 19> confidence{};  ///< 0..1; exp(-sigma_m / 5 cm) if from triangulation, else the file's
};

/// The skeleton as defined, else by its name, or free points (geometry::PointsSkeleton) where the table has joints that the
/// skeleton lacks.
geometry::Skeleton SkeletonOf(const Pose3d& pose);

/// Makes `skeleton` that of the pose. Throws FormatError (path) for joints of the table that it lacks.
void UseSkeleton(const geometry::Skeleton& skeleton, const std::string& path, Pose3d* pose);

/// Joints of one person in one frame, in the order of a skeleton.
struct JointsPose {
  Eigen::Matrix3Xd x_in_world;  ///< metres; zero where not valid
  std::vector<bool> valid;
  std::vector<double> confidence;  ///< as in Coco19Pose
};

/// frame -> person -> all joints of the pose's own skeleton.
std::map<int, std::map<int, JointsPose>> ToJoints(const Pose3d& pose, const geometry::Skeleton& skeleton);

/// Joints with points that give none of Panoptic's 19.
std::vector<std::string> JointsBeyondCoco19(const Pose3d& pose);

/// frame -> person -> pose; missing joints stay missing.
std::map<int, std::map<int, Coco19Pose>> ToCoco19(const Pose3d& pose);

}  // namespace mvstudio::dataset
