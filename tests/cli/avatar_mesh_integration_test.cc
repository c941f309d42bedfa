#include <filesystem>
#include <fstream>
#include <sstream>

#include "avatar/body/articulated_pose.h"
#include "avatar/body/files/textured_person.h"
#include "geometry/rigid/rigid3.h"
#include "tests/support/run_cli.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

/// `avatar mesh` as a program.
namespace mvstudio::testing {
namespace {

namespace fs = std::filesystem;

/// A mannequin that walks and bends: frames 3, 4 and 17.
body::TexturedPerson Walker() {
  body::TexturedPerson person;
  person.person.body = body::MakeMannequin(1.75, 0.3);
  person.textures = body::MannequinTextures(16, 3);
  for (const int frame : {3, 4, 17}) {
    body::ArticulatedPose pose;
    pose.shift = Eigen::Vector3d(0.1 * frame, 2, 0);
    for (size_t b = 0; b < person.person.body.bone_names.size(); ++b)
      pose.local_rotations.push_back(
          geometry::RotationExp(Eigen::Vector3d(0.02 * frame, 0.01 * static_cast<double>(b % 5), 0)));
    person.person.seen[frame] = pose;
  }
  return person;
}

std::vector<Eigen::Vector3f> VerticesOf(const std::string& path) {
  std::ifstream file(path);
  std::vector<Eigen::Vector3f> vertices;
  for (std::string line; std::getline(file, line);) {
    std::istringstream words(line);
    std::string kind;
    Eigen::Vector3f v;
    if (words >> kind >> v[0] >> v[1] >> v[2] && kind == "v") vertices.push_back(v);
  }
  return vertices;
}

TEST(AvatarMesh, EveryFrameIsTheSkinnedBody) {
  const TempDir folder;
  const body::TexturedPerson person = Walker();
  WritePerson(person, folder / "body/body.npz");
  const CliRun run = RunCli({"avatar", "mesh", folder / "body", "--out", folder / "obj", "--json"});
  ASSERT_EQ(run.exit, 0) << run.err;
  EXPECT_EQ(run.Json()["metrics"]["frames"], 3);
  for (const auto& [frame, pose] : person.person.seen) {
    const auto vertices = VerticesOf(folder / ("obj/FRAME_" + std::to_string(100000000 + frame).substr(1) + ".obj"));
    const Eigen::Matrix3Xf expected = SkinVertices(person.person.body, ToBodyPose(person.person.body, pose));
    ASSERT_EQ(static_cast<Eigen::Index>(vertices.size()), expected.cols());
    float worst = 0;
    for (size_t i = 0; i < vertices.size(); ++i)
      worst = std::max(worst, (vertices[i] - expected.col(static_cast<Eigen::Index>(i))).norm());
    EXPECT_LT(worst, 1e-5);
  }
  EXPECT_THAT(Slurp(folder / "obj/body.mtl"), HasSubstr("map_Kd body.png"));
  EXPECT_TRUE(fs::exists(folder / "obj/body.png"));
}

TEST(AvatarMesh, FramesAreChosenAndForeignFoldersKept) {
  const TempDir folder;
  WritePerson(Walker(), folder / "body.npz");
  const std::vector<std::string> line = {"avatar", "mesh", folder / "body.npz", "--out", folder / "obj"};
  const auto with = [&line](std::vector<std::string> words) {
    words.insert(words.begin(), line.begin(), line.end());
    return RunCli(words);
  };
  const CliRun missing = with({"--frames", "3-4,6-16"});
  EXPECT_EQ(missing.exit, 2);
  EXPECT_THAT(missing.err, HasSubstr("has no frame 6; it has 3 frames from 3 to 17"));
  EXPECT_FALSE(fs::exists(folder / "obj"));
  EXPECT_EQ(with({"--frames", "3-5"}).exit, 0);  // those of a range that there are
  EXPECT_TRUE(fs::exists(folder / "obj/FRAME_00000004.obj"));
  EXPECT_FALSE(fs::exists(folder / "obj/FRAME_00000017.obj"));
  EXPECT_EQ(with({}).exit, 2);  // there already
  EXPECT_EQ(with({"--overwrite"}).exit, 0);
  EXPECT_TRUE(fs::exists(folder / "obj/FRAME_00000017.obj"));
  std::ofstream(folder / "obj/thesis.txt") << "mine";
  EXPECT_EQ(with({"--overwrite"}).exit, 2);
  EXPECT_EQ(Slurp(folder / "obj/thesis.txt"), "mine");
  body::TexturedPerson still = Walker();
  still.person.seen.clear();
  WritePerson(still, folder / "still/body.npz");
  const CliRun nothing = RunCli({"avatar", "mesh", folder / "still", "--out", folder / "none"});
  EXPECT_EQ(nothing.exit, 3);
  EXPECT_THAT(nothing.err, HasSubstr("holds no pose of any frame"));
}

}  // namespace
}  // namespace mvstudio::testing
