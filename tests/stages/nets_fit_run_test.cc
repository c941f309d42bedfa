#include <cstring>
#include <filesystem>

#include "core/disk/files.h"
#include "core/error.h"
#include "report/page/body_file.h"
#include "stages/nets/fit/describe.h"
#include "tests/avatar/panoptic_fixture.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

/// Options in, report out, without the program.
namespace mvstudio::stages {
namespace {

std::vector<std::string> RolesOf(const CommandResult& result) {
  std::vector<std::string> roles;
  for (const CommandResult::Output& output : result.outputs) roles.push_back(output.role);
  return roles;
}

std::vector<std::string> CodesOfWarnings(const CommandResult& result) {
  std::vector<std::string> codes;
  for (const Notice& notice : result.warnings) codes.push_back(notice.code);
  return codes;
}

/// What the report's studio shows, decoded here: linear blend skinning of each frame, as the body itself has it.
void ExpectMotion(const std::string& bytes, body::PersonBody person) {
  ASSERT_TRUE(report::IsBodyFile(bytes));
  person.body.moving_offsets = nullptr, person.body.pose_directions.resize(0, 0);
  const Eigen::Index num_vertices = person.body.vertices.cols(), num_faces = person.body.faces.cols();
  const auto bones = static_cast<Eigen::Index>(person.body.bone_names.size()),
             steps = static_cast<Eigen::Index>(person.seen.size());
  const char* at = bytes.data() + 24;
  const auto take = [&](auto one, Eigen::Index count) {
    std::vector<decltype(one)> values(static_cast<size_t>(count));
    std::memcpy(values.data(), at, values.size() * sizeof one);
    at += values.size() * sizeof one;
    return values;
  };
  const auto box = take(0.f, 6);
  const auto frames = take(int32_t{}, steps);
  take(uint32_t{}, 3 * num_faces);
  const auto shifts = take(0.f, 3 * bones * steps);
  const auto turns = take(int16_t{}, 4 * bones * steps);
  const auto rest = take(uint16_t{}, 3 * num_vertices);
  const auto bone_of = take(uint8_t{}, 4 * num_vertices), weights = take(uint8_t{}, 4 * num_vertices);
  ASSERT_EQ(at, bytes.data() + bytes.size());
  size_t step = 0;
  for (const auto& [frame, pose] : person.seen) {
    EXPECT_EQ(frames[step], frame);
    const Eigen::Matrix3Xf expected = body::SkinVertices(person.body, body::ToBodyPose(person.body, pose));
    double worst = 0;
    for (Eigen::Index v = 0; v < num_vertices; ++v) {
      Eigen::Vector3d x, sum = Eigen::Vector3d::Zero();
      double total = 0;
      for (size_t k = 0; k < 3; ++k)
        x[static_cast<Eigen::Index>(k)] = box[k] + (box[3 + k] - box[k]) * rest[static_cast<size_t>(3 * v) + k] / 65535.0;
      for (size_t k = static_cast<size_t>(4 * v); k < static_cast<size_t>(4 * v) + 4; ++k) {
        const size_t b = step * static_cast<size_t>(bones) + bone_of[k];
        const Eigen::Quaterniond turn(turns[4 * b + 3], turns[4 * b], turns[4 * b + 1], turns[4 * b + 2]);
        sum += weights[k] * (turn.normalized() * x + Eigen::Vector3d(shifts[3 * b], shifts[3 * b + 1], shifts[3 * b + 2]));
        total += weights[k];
      }
      worst = std::max(worst, (sum / total - expected.col(v).cast<double>()).norm());
    }
    EXPECT_LT(worst, 0.004) << "weights of 8 bits, at frame " << frame;
    ++step;
  }
}

/// Its colours: the same triangles, each corner in the chart of its part, and a small image.
void ExpectTexture(const std::string& bytes, const body::BodyTemplate& body) {
  ASSERT_TRUE(report::IsBodyTexture(bytes));
  EXPECT_FALSE(report::IsBodyTexture(bytes.substr(0, bytes.size() - 1))) << "one that was cut";
  uint32_t counts[3];
  std::memcpy(counts, bytes.data() + 8, sizeof counts);
  ASSERT_EQ(counts[1], static_cast<uint32_t>(body.faces.cols()));
  EXPECT_LT(counts[2], 256U << 10);
  std::vector<uint32_t> vertices(counts[0]), corners(3 * size_t{counts[1]});
  std::memcpy(vertices.data(), bytes.data() + 20, 4 * vertices.size());
  std::memcpy(corners.data(), bytes.data() + 20 + 8 * vertices.size(), 4 * corners.size());
  for (size_t k = 0; k < corners.size(); ++k) {
    ASSERT_LT(corners[k], counts[0]);
    ASSERT_EQ(vertices[corners[k]], static_cast<uint32_t>(body.faces.data()[k])) << "corner " << k;
  }
}

TEST(AvatarFitStage, TheMannequinLiesOnItsOwnSilhouettes) {
  const TempDir folder;
  avatar::WriteMannequinDataset(folder / "data", 4, 4, 96);
  AvatarFitOptions options;
  options.dataset = folder / "data", options.out = folder / "body";
  options.split.holdout_cameras = "00_03", options.split.frames = "0-9";
  options.person.fit_surface = false, options.person.texture_px = 8;
  const AvatarFitReport report = RunAvatarFit(options);
  const body::TexturedPerson kept = body::ReadPerson(folder / "body/body.npz");
  EXPECT_EQ(kept.frames, (std::vector<int>{0, 1, 2, 3}));
  EXPECT_THAT(kept.cameras, SizeIs(3)) << "the held-out one is not looked at";
  ASSERT_THAT(report.fit.fit.cameras, SizeIs(3));
  for (const body::CameraFit& camera : report.fit.fit.cameras) EXPECT_GT(camera.iou, 0.75) << camera.name;
  ASSERT_THAT(report.notes.warnings, SizeIs(1)) << "frames 4 to 9 are not there";
  EXPECT_EQ(report.notes.warnings[0].code, "CLI-FRAMES");
  EXPECT_TRUE(std::filesystem::exists(folder / "body/body.glb"));
  EXPECT_EQ(std::filesystem::exists(folder / "body/surface.png"), report.surface.has_value());
  ExpectMotion(ReadFile(folder / "body/body_motion.bin"), kept.person);
  ExpectTexture(ReadFile(folder / "body/body_texture.bin"), kept.person.body);
  EXPECT_THAT(RolesOf(Describe(report)), ::testing::IsSupersetOf({"body-motion", "body-texture"}));
  EXPECT_THAT(MessageOf<UsageError>([&] { RunAvatarFit(options); }), HasSubstr("option 'overwrite'"));
}

TEST(AvatarFitStage, FilesScalesAndDoubtsAreSaid) {
  AvatarFitReport report;
  report.folder = "body", report.dataset = "data";
  report.fit.fit.cameras = {{"00_00", 20, 0, 0.85, 0.95, {0, 0}, 0.1}};
  report.fit.missing = {"camera 00_00, frame 3"};
  report.conflicts = {{"DAT-COVER", "masks: of another take", ""}};
  report.notes.warnings = {{"CLI-FRAMES", "frames 5 to 9", ""}};
  const CommandResult plain = Describe(report);
  EXPECT_THAT(RolesOf(plain), ElementsAre("body", "body-glb", "texture"));
  EXPECT_THAT(plain.inputs, ElementsAre("data"));
  EXPECT_EQ(plain.folder, "body");
  EXPECT_THAT(CodesOfWarnings(plain), ElementsAre("CLI-FRAMES", "BODY-MISSING", "DAT-COVER"));
  EXPECT_FALSE(plain.metrics.contains("surface_maps"));
  report.surface = SurfaceLimits{15, 10};
  const CommandResult mapped = Describe(report);
  EXPECT_THAT(RolesOf(mapped), ElementsAre("body", "body-glb", "texture", "surface-maps"));
  EXPECT_EQ(mapped.metrics["surface_maps"]["offset_limit_mm"], 15);
  report.fit.fit.cameras[0].iou = 0;
  EXPECT_EQ(Describe(report).exit, kExitQualityGate);
}

}  // namespace
}  // namespace mvstudio::stages
