#include "avatar/body/files/textured_person.h"

#include <cmath>

#include "avatar/body/files/person_file.h"
#include "core/error.h"

namespace mvstudio::body {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

constexpr const char *kSigma = "joint_sigma_m", *kPoses = "poses", *kTextures = "textures", *kPriorSigma = "habit_sigma_rad",
                     *kCameras = "cameras", *kFrames = "frames", *kOffsets = "offset_m", *kOffsetSigma = "offset_sigma_m";

std::string PriorName(size_t bone) { return "habit_" + std::to_string(bone); }

/// A row a pose: frame, shift, then a quaternion x, y, z, w a bone.
MatrixXd PoseRows(const std::map<int, ArticulatedPose>& poses, size_t bones) {
  MatrixXd rows(static_cast<Index>(poses.size()), static_cast<Index>(4 + 4 * bones));
  Index i = 0;
  for (const auto& [frame, pose] : poses) {
    rows(i, 0) = frame, rows.block<1, 3>(i, 1) = pose.shift.transpose();
    for (size_t b = 0; b < bones; ++b)
      rows.block<1, 4>(i, static_cast<Index>(4 + 4 * b)) = pose.local_rotations[b].coeffs().transpose();
    ++i;
  }
  return rows;
}

MatrixXd CameraRows(const std::vector<std::array<int, 2>>& cameras) {
  MatrixXd rows(static_cast<Index>(cameras.size()), 2);
  for (Index i = 0; i < rows.rows(); ++i) rows.row(i) << cameras[static_cast<size_t>(i)][0], cameras[static_cast<size_t>(i)][1];
  return rows;
}

MatrixXd FrameRows(const std::vector<int>& frames) {
  return Eigen::Map<const Eigen::VectorXi>(frames.data(), static_cast<Index>(frames.size())).cast<double>();
}

/// A row a chart: its pixels, row by row, R, G, B.
MatrixXd TextureRows(const Textures& textures) {
  MatrixXd rows(kNumParts, static_cast<Index>(textures[0].pixels.size()));
  for (Index k = 0; k < kNumParts; ++k) {
    const std::vector<uint8_t>& pixels = textures[static_cast<size_t>(k)].pixels;
    for (Index i = 0; i < rows.cols(); ++i) rows(k, i) = pixels[static_cast<size_t>(i)];
  }
  return rows;
}

/// The extra arrays of a file, checked.
class Extras {
 public:
  Extras(const PersonFile& file, const std::string& path) : file_(file), path_(path) {}

  [[noreturn]] void Refuse(const std::string& name, const std::string& why) const {
    throw FormatError(path_, "extra." + name, why);
  }
  bool Has(const std::string& name) const { return file_.extras.count(name) > 0; }

  /// Whole numbers below a billion; none where there is no such array.
  Eigen::MatrixXi Whole(const std::string& name, Index columns) const {
    if (!Has(name)) return Eigen::MatrixXi(0, columns);
    const MatrixXd& matrix = Get(name, -1, columns);
    if (matrix.size() > 0 && (matrix.array().abs() >= 1e9 || matrix.array() != matrix.array().floor()).any())
      Refuse(name, "holds something else than whole numbers");
    return matrix.cast<int>();
  }

  /// -1: any number. All values are finite.
  const MatrixXd& Get(const std::string& name, Index rows, Index columns) const {
    const auto found = file_.extras.find(name);
    if (found == file_.extras.end()) Refuse(name, "is missing: not the file of a fitted body");
    const MatrixXd& matrix = found->second;
    if ((rows >= 0 && matrix.rows() != rows) || (columns >= 0 && matrix.cols() != columns))
      Refuse(name, "has another size than the body");
    if (!matrix.allFinite()) Refuse(name, "is not finite");
    return matrix;
  }

 private:
  const PersonFile& file_;
  const std::string& path_;
};

std::map<int, ArticulatedPose> ReadPoses(const Extras& extras, size_t bones) {
  const MatrixXd& rows = extras.Get(kPoses, -1, static_cast<Index>(4 + 4 * bones));
  std::map<int, ArticulatedPose> poses;
  for (Index i = 0; i < rows.rows(); ++i) {
    const double frame = rows(i, 0);
    if (!(std::abs(frame) < 1e9) || frame != std::floor(frame)) extras.Refuse(kPoses, "a frame is not a whole number");
    ArticulatedPose pose;
    pose.shift = rows.block<1, 3>(i, 1).transpose();
    for (size_t b = 0; b < bones; ++b) {
      pose.local_rotations.emplace_back(Eigen::Vector4d(rows.block<1, 4>(i, static_cast<Index>(4 + 4 * b)).transpose()));
      if (std::abs(pose.local_rotations.back().norm() - 1) > 1e-6) extras.Refuse(kPoses, "a rotation is no unit quaternion");
    }
    if (!poses.emplace(static_cast<int>(frame), pose).second) extras.Refuse(kPoses, "a frame occurs twice");
  }
  return poses;
}

LearnedRotationPrior ReadPriors(const Extras& extras, const BodyTemplate& body) {
  LearnedRotationPrior priors;
  if (!extras.Has(kPriorSigma)) return priors;
  const size_t bones = body.bone_names.size();
  const MatrixXd& sigma = extras.Get(kPriorSigma, static_cast<Index>(bones), 1);
  for (size_t b = 0; b < bones; ++b) {
    LearnedRotationPrior::Bone bone;
    bone.sigma_rad = sigma(static_cast<Index>(b), 0);
    const Index features = LearnedRotationPrior::NumFeatures(body, static_cast<int>(b));
    if (extras.Has(PriorName(b))) bone.weights = extras.Get(PriorName(b), 3, features);
    priors.bones.push_back(bone);
  }
  return priors;
}

Textures ReadTextures(const Extras& extras) {
  const MatrixXd& rows = extras.Get(kTextures, kNumParts, -1);
  const auto size = static_cast<int>(std::lround(std::sqrt(static_cast<double>(rows.cols()) / 3)));
  if (size < 2 || Index{3} * size * size != rows.cols()) extras.Refuse(kTextures, "is not 24 squares of RGB");
  if (rows.minCoeff() < 0 || rows.maxCoeff() > 255) extras.Refuse(kTextures, "leaves 0 to 255");
  Textures textures;
  for (Index k = 0; k < kNumParts; ++k) {
    Image& texture = textures[static_cast<size_t>(k)] = Image(size, size, 3);
    for (Index i = 0; i < rows.cols(); ++i) texture.pixels[static_cast<size_t>(i)] = static_cast<uint8_t>(rows(k, i));
  }
  return textures;
}

}  // namespace

void WritePerson(const TexturedPerson& person, const std::string& path) {
  const PersonBody& fitted = person.person;
  PersonFile file{fitted.body, {}};
  file.extras[kSigma] = MatrixXd::Constant(1, 1, fitted.joint_sigma_m);
  file.extras[kPoses] = PoseRows(fitted.seen, fitted.body.bone_names.size());
  file.extras[kTextures] = TextureRows(person.textures);
  file.extras[kCameras] = CameraRows(person.cameras);
  file.extras[kFrames] = FrameRows(person.frames);
  if (person.offset_m.size() > 0) file.extras[kOffsets] = person.offset_m;
  if (person.offset_sigma_m.size() > 0) file.extras[kOffsetSigma] = person.offset_sigma_m;
  const std::vector<LearnedRotationPrior::Bone>& priors = fitted.priors.bones;
  if (!priors.empty()) file.extras[kPriorSigma] = MatrixXd(static_cast<Index>(priors.size()), 1);
  for (size_t b = 0; b < priors.size(); ++b) {
    file.extras[kPriorSigma](static_cast<Index>(b), 0) = priors[b].sigma_rad;
    if (priors[b].weights.size() > 0) file.extras[PriorName(b)] = priors[b].weights;
  }
  WritePersonFile(path, file);
}

TexturedPerson ReadPerson(const std::string& path) {
  PersonFile file = ReadPersonFile(path);
  const Extras extras(file, path);
  TexturedPerson person;
  PersonBody& fitted = person.person;
  fitted.joint_sigma_m = extras.Get(kSigma, 1, 1)(0, 0);
  if (!(fitted.joint_sigma_m > 0)) extras.Refuse(kSigma, "must be positive");
  fitted.seen = ReadPoses(extras, file.body.bone_names.size());
  fitted.priors = ReadPriors(extras, file.body);
  person.textures = ReadTextures(extras);
  const Eigen::MatrixXi cameras = extras.Whole(kCameras, 2), frames = extras.Whole(kFrames, 1);
  for (Index i = 0; i < cameras.rows(); ++i) person.cameras.push_back({cameras(i, 0), cameras(i, 1)});
  person.frames.assign(frames.data(), frames.data() + frames.size());
  const Index vertices = file.body.vertices.cols();
  if (extras.Has(kOffsets)) person.offset_m = extras.Get(kOffsets, vertices, 1);
  if (extras.Has(kOffsetSigma)) person.offset_sigma_m = extras.Get(kOffsetSigma, vertices, 1);
  fitted.body = std::move(file.body);
  return person;
}

}  // namespace mvstudio::body
