#include "avatar/body/files/textured_person.h"

#include "avatar/body/files/person_file.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "core/random.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::body {
namespace {

TexturedPerson Person() {
  TexturedPerson person;
  person.person.body = MakeMannequin(1.75, 0.3);
  person.person.joint_sigma_m = 0.0123;
  person.textures = MannequinTextures(16, 3);
  person.offset_m = Eigen::VectorXd::Random(person.person.body.vertices.cols());
  person.offset_sigma_m = person.offset_m.cwiseAbs();
  person.cameras = {{{0, 3}}, {{0, 12}}}, person.frames = {3, 17};
  Rng rng(2);
  const size_t bones = person.person.body.bone_names.size();
  for (const int frame : {3, 17, 200}) {
    ArticulatedPose pose;
    pose.shift = Eigen::Vector3d(rng.Normal(), rng.Normal(), rng.Normal());
    for (size_t b = 0; b < bones; ++b)
      pose.local_rotations.push_back(geometry::RotationExp(Eigen::Vector3d(rng.Normal(), rng.Normal(), rng.Normal())));
    person.person.seen[frame] = pose;
  }
  for (size_t b = 0; b < bones; ++b) {
    LearnedRotationPrior::Bone bone;
    bone.sigma_rad = 0.01 * static_cast<double>(b + 1);
    if (b % 2)
      bone.weights = Eigen::Matrix3Xd::Random(3, LearnedRotationPrior::NumFeatures(person.person.body, static_cast<int>(b)));
    person.person.priors.bones.push_back(bone);
  }
  return person;
}

TEST(TexturedPerson, ComesBackAsItWasWritten) {
  const TempDir folder;
  const TexturedPerson written = Person();
  WritePerson(written, folder / "body.npz");
  const TexturedPerson read = ReadPerson(folder / "body.npz");
  EXPECT_EQ(read.person.body.vertices, written.person.body.vertices);
  EXPECT_EQ(read.person.body.bone_roles, written.person.body.bone_roles);
  EXPECT_EQ(read.person.joint_sigma_m, written.person.joint_sigma_m);
  ASSERT_EQ(read.person.seen.size(), 3u);
  for (const auto& [frame, pose] : written.person.seen) {
    EXPECT_EQ(read.person.seen.at(frame).shift, pose.shift);
    for (size_t b = 0; b < pose.local_rotations.size(); ++b)
      EXPECT_LT(geometry::RotationAngle(read.person.seen.at(frame).local_rotations[b], pose.local_rotations[b]), 1e-7);
  }
  for (size_t b = 0; b < written.person.priors.bones.size(); ++b)
    EXPECT_EQ(read.person.priors.bones[b].weights, written.person.priors.bones[b].weights);
  EXPECT_EQ(read.cameras, written.cameras);
  EXPECT_EQ(read.offset_m, written.offset_m);
  EXPECT_EQ(read.offset_sigma_m, written.offset_sigma_m);
  EXPECT_EQ(read.frames, written.frames);
  for (int k = 0; k < kNumParts; ++k) EXPECT_EQ(read.textures[k].pixels, written.textures[k].pixels);
}

TEST(TexturedPerson, WithoutPriorsThereAreNone) {
  const TempDir folder;
  TexturedPerson person = Person();
  person.person.priors.bones.clear();
  WritePerson(person, folder / "body.npz");
  EXPECT_TRUE(ReadPerson(folder / "body.npz").person.priors.bones.empty());
}

/// What reading says of a file whose extra array has been changed.
template <class Change>
std::string Refusal(const Change& change) {
  const TempDir folder;
  WritePerson(Person(), folder / "body.npz");
  PersonFile file = ReadPersonFile(folder / "body.npz");
  change(file.extras);
  WritePersonFile(folder / "changed.npz", file);
  return MessageOf<FormatError>([&] { ReadPerson(folder / "changed.npz"); });
}

TEST(TexturedPerson, DamageIsNamed) {
  using Extras = std::map<std::string, Eigen::MatrixXd>;
  EXPECT_THAT(Refusal([](Extras& e) { e.erase("poses"); }), AllOf(HasSubstr("extra.poses"), HasSubstr("missing")));
  EXPECT_THAT(Refusal([](Extras& e) { e["poses"](1, 6) += 0.5; }), HasSubstr("no unit quaternion"));
  EXPECT_THAT(Refusal([](Extras& e) { e["poses"](1, 0) = 3; }), HasSubstr("occurs twice"));
  EXPECT_THAT(Refusal([](Extras& e) { e["poses"](1, 0) = 3.5; }), HasSubstr("whole number"));
  EXPECT_THAT(Refusal([](Extras& e) { e["habit_3"].conservativeResize(3, 5); }), HasSubstr("another size"));
  EXPECT_THAT(Refusal([](Extras& e) { e["habit_3"](0, 0) = std::nan(""); }), HasSubstr("not finite"));
  EXPECT_THAT(Refusal([](Extras& e) { e["textures"](0, 0) = 256; }), HasSubstr("0 to 255"));
  EXPECT_THAT(Refusal([](Extras& e) { e["textures"].conservativeResize(24, 100); }), HasSubstr("24 squares"));
  EXPECT_THAT(Refusal([](Extras& e) { e["frames"](0, 0) = 0.5; }), HasSubstr("whole numbers"));
  EXPECT_THAT(Refusal([](Extras& e) { e["cameras"].conservativeResize(2, 1); }), HasSubstr("another size"));
  EXPECT_THAT(Refusal([](Extras& e) { e["joint_sigma_m"](0, 0) = 0; }), HasSubstr("positive"));
}

}  // namespace
}  // namespace mvstudio::body
