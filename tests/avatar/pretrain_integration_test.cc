#include <ATen/ATen.h>

#include "avatar/run/pack/pack_rows.h"
#include "avatar/run/pack/template_view.h"
#include "avatar/run/pack/training_set.h"
#include "avatar/run/pretrain/motion_clips.h"
#include "avatar/run/pretrain/pretrain_samples.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "dataset/views/crop.h"
#include "tests/avatar/panoptic_fixture.h"
#include "tests/support/message_of.h"
#include "tests/support/test.h"

/// Samples of a pretraining beside the training packs of a dataset.
namespace mvstudio::avatar {
namespace {

class Pretrain : public ::testing::Test {
 protected:
  Pretrain() : folder_("pretrain") { WriteMannequinDataset(folder_.path(), 3, 6, 96); }
  TemporaryFolder folder_;
};

/// What is learned from samples is what avatars are trained with: the same numbers for left and right, parts and charts.
TEST_F(Pretrain, ASampleOfTheSameBodyPoseAndCameraIsBuildPacks) {
  const dataset::PanopticDataset data = dataset::OpenPanopticDataset(folder_.path());
  TrainingSetOptions options;
  options.size_px = 64, options.fit_shape = false;
  options.shape.girth = {1.2, 0.9, 1.1, 0.8};
  const TrainingSet built = BuildTrainingSet(data, options, {});
  ASSERT_EQ(built.pack.size(), 18);
  AvatarPack samples = EmptyPack({"a"}, built.pack.size(), options);
  const body::BodyTemplate body = ScaleGirth(body::MakeMannequin(), options.shape);
  for (int64_t i = 0; i < built.pack.size(); ++i) {
    const auto& camera = data.rig.cameras[static_cast<size_t>(built.pack.camera_idx[i].item<int64_t>())];
    const dataset::Coco19Pose& pose = data.poses.at(built.pack.frame[i].item<int>()).at(0);
    const auto extent = dataset::MeasurePerson(pose, camera);
    const auto crop = dataset::CropCamera(camera, extent->middle_in_cam, built.half_extent_m, options.fill, options.size_px);
    FillSample(samples, i, body, *PosedVertices(body, pose), pose, crop);
  }
  EXPECT_TRUE(at::equal(samples.part, built.pack.part));
  EXPECT_TRUE(at::equal(samples.uv, built.pack.uv));
  EXPECT_TRUE(at::equal(samples.joints_in_cam, built.pack.joints_in_cam));
  EXPECT_TRUE(at::equal(samples.joint_valid, built.pack.joint_valid));
  EXPECT_TRUE(at::equal(samples.intrinsics, built.pack.intrinsics));
  EXPECT_TRUE(at::equal(samples.masks > 0, samples.part > 0));
}

TEST_F(Pretrain, ADatasetGivesThoseFramesThatAreAskedFor) {
  const std::vector<MotionClip> all = ClipsOfDataset(folder_.path(), {});
  ASSERT_EQ(all.size(), 1u);
  EXPECT_THAT(all[0].frames, ElementsAre(0, 1, 2, 3, 4, 5));
  const std::vector<MotionClip> some = ClipsOfDataset(folder_.path(), {1, 4});
  ASSERT_EQ(some.size(), 1u);
  EXPECT_THAT(some[0].frames, ElementsAre(1, 4));
  EXPECT_EQ(some[0].poses[1].x_in_world, all[0].poses[4].x_in_world);
  EXPECT_THAT(MessageOf<UsageError>([&] { ClipsOfDataset(folder_.path(), {1, 9}); }), HasSubstr("frame 9 is not in"));
  EXPECT_THROW(ClipsOfDataset(folder_.path() + "/nothing", {}), IoError);
  EXPECT_THROW(ClipsOfDataset(folder_.path() + "/masks", {}), IoError);
}

TEST_F(Pretrain, AnAnimationGetsAnAdultsBoneLengths) {
  std::string bvh =
      "HIERARCHY\nROOT Hips\n{\nOFFSET 0 0 0\nCHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation\n";
  const auto chain = [&](const std::string& side, const std::vector<std::pair<std::string, std::string>>& joints) {
    for (const auto& [name, offset] : joints)
      bvh += "JOINT " + side + name + "\n{\nOFFSET " + offset + "\nCHANNELS 3 Zrotation Xrotation Yrotation\n";
    bvh += "End Site\n{\nOFFSET 0 -1 0\n}\n";
    for (size_t i = 0; i < joints.size(); ++i) bvh += "}\n";
  };
  chain("Left", {{"UpLeg", "10 0 0"}, {"Leg", "0 -70 0"}, {"Foot", "0 -20 0"}});
  chain("Right", {{"UpLeg", "-10 0 0"}, {"Leg", "0 -70 0"}, {"Foot", "0 -20 0"}});
  bvh += "JOINT Neck\n{\nOFFSET 0 50 0\nCHANNELS 3 Zrotation Xrotation Yrotation\n";
  chain("Left", {{"Arm", "20 0 0"}, {"ForeArm", "30 0 0"}, {"Hand", "25 0 0"}});
  chain("Right", {{"Arm", "-20 0 0"}, {"ForeArm", "-30 0 0"}, {"Hand", "-25 0 0"}});
  bvh += "}\n}\nMOTION\nFrames: 2\nFrame Time: 0.033\n";
  for (int f = 0; f < 2; ++f) {
    bvh += "0 90 0";
    for (int i = 0; i < 3 + 13 * 3; ++i) bvh += " 0";
    bvh += "\n";
  }
  const std::string path = folder_.path() + "/a.bvh";
  WriteFileAtomic(path, bvh);
  const MotionClip clip = ClipOfBvh(path);
  ASSERT_EQ(clip.poses.size(), 2u);
  const body::BodyTemplate adult = body::MakeMannequin();
  for (const auto& [a, b] : {std::pair{6, 7}, {7, 8}, {3, 4}, {4, 5}, {12, 13}}) {
    EXPECT_NEAR((clip.poses[0].x_in_world.col(a) - clip.poses[0].x_in_world.col(b)).norm(),
                (adult.coco19.col(a) - adult.coco19.col(b)).norm(), 0.01)
        << a << " " << b;
  }
  EXPECT_GT(clip.poses[0].x_in_world(2, 0), clip.poses[0].x_in_world(2, 8) + 1) << "z is up";
  EXPECT_THROW(ClipOfBvh(folder_.path() + "/nothing.bvh"), IoError);
}

}  // namespace
}  // namespace mvstudio::avatar
