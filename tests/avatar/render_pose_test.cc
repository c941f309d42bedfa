#include "avatar/run/render/render_pose.h"

#include <Eigen/Geometry>

#include "avatar/maps/bone_lists.h"
#include "avatar/run/render/backdrop.h"
#include "avatar/run/render/bvh_pose.h"
#include "core/choice/frame_choice.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "core/format.h"
#include "tests/avatar/panoptic_fixture.h"
#include "tests/support/message_of.h"
#include "tests/support/test.h"
#include "tests/support/test_data.h"

namespace mvstudio::avatar {
namespace {

using dataset::Coco19Pose;

Coco19Pose Mannequin(double angle, const Eigen::Vector3d& at = {0.3, -0.4, 0}) {
  static const body::BodyTemplate body = body::MakeMannequin(1.75, 0.3);
  Coco19Pose pose;
  pose.x_in_world = body::PosedCoco19(body, SwingPose(body, angle)).colwise() + at;
  pose.valid.fill(true), pose.confidence.fill(1);
  return pose;
}

std::vector<Coco19Pose> Swing() {
  std::vector<Coco19Pose> poses;
  for (int k = 0; k < 7; ++k) poses.push_back(Mannequin(0.1 * k, {0.05 * k, 0.1 - 0.02 * k, 0}));
  return poses;
}

TEST(NormaliseScale, UndoesAFactorAboutTheOriginToRounding) {
  const std::vector<Coco19Pose> poses = Swing();
  const SkeletonSize trained = MeasureSkeleton(poses);
  for (const double factor : {0.7, 1.4, 100.0, 1e-3}) {
    std::vector<Coco19Pose> scaled = poses;
    for (Coco19Pose& pose : scaled) pose.x_in_world *= factor;
    const double ratio = SizeRatio(trained, MeasureSkeleton(scaled), "test");
    EXPECT_NEAR(ratio * factor, 1, 1e-12);
    for (size_t i = 0; i < poses.size(); ++i) {
      const double gap = (NormaliseScale(scaled[i], trained, ratio).x_in_world - poses[i].x_in_world).cwiseAbs().maxCoeff();
      EXPECT_LT(gap, 1e-12) << "the mannequin's bones keep their lengths, so nothing else changes";
    }
  }
}

TEST(NormaliseScale, GivesTheTrainedLengthsAndKeepsDirections) {
  const SkeletonSize trained = MeasureSkeleton(Swing());
  Coco19Pose child = Mannequin(0.4);
  Eigen::Matrix3d stretch = Eigen::Vector3d(0.5, 0.6, 0.8).asDiagonal();  // other proportions, not only another size
  child.x_in_world = stretch * child.x_in_world;
  const double ratio = SizeRatio(trained, MeasureSkeleton({child}), "test");
  const Coco19Pose adult = NormaliseScale(child, trained, ratio);
  EXPECT_NEAR((adult.x_in_world.col(2) - ratio * child.x_in_world.col(2)).norm(), 0, 1e-12);
  for (size_t b = 0; b < kBones.size(); ++b) {
    const auto [a, c] = kBones[b];
    const Eigen::Vector3d before = child.x_in_world.col(c) - child.x_in_world.col(a),
                          after = adult.x_in_world.col(c) - adult.x_in_world.col(a);
    EXPECT_NEAR(after.norm(), trained.length_m[b], 1e-12) << b;
    EXPECT_NEAR(before.normalized().dot(after.normalized()), 1, 1e-12) << b;
  }
}

TEST(NormaliseScale, WhatBendsInTrainingStaysBent) {
  std::vector<Coco19Pose> training;
  for (int k = 0; k < 21; ++k) {  // the nose comes up to 20 % nearer to the neck when the head is bowed
    training.push_back(Mannequin(0.05 * k));
    const Eigen::Vector3d neck = training.back().x_in_world.col(0), nose = training.back().x_in_world.col(1);
    training.back().x_in_world.col(1) = neck + (1 - 0.01 * k) * (nose - neck);
  }
  const SkeletonSize trained = MeasureSkeleton(training);
  for (const int k : {3, 10, 17}) {
    Coco19Pose child = training[k];
    child.x_in_world *= 0.6;
    const double ratio = SizeRatio(trained, MeasureSkeleton({child}), "test");
    EXPECT_NEAR(ratio, 1 / 0.6, 1e-9);
    EXPECT_LT((NormaliseScale(child, trained, ratio).x_in_world.col(1) - training[k].x_in_world.col(1)).norm(), 1e-9) << k;
    child.x_in_world.col(1) += 0.5 * (child.x_in_world.col(1) - child.x_in_world.col(0));  // longer than any
    const Coco19Pose out = NormaliseScale(child, trained, ratio);
    EXPECT_NEAR((out.x_in_world.col(1) - out.x_in_world.col(0)).norm(), trained.long_m[0], 1e-9);
  }
}

TEST(NormaliseScale, MissingJointsStayMissingAndWildOnesGo) {
  const SkeletonSize trained = MeasureSkeleton(Swing());
  Coco19Pose pose = Mannequin(0.2);
  const Coco19Pose whole = NormaliseScale(pose, trained, 1);
  pose.valid[4] = false;                                 // left elbow: the wrist hangs from the shoulder
  pose.x_in_world.col(13) += Eigen::Vector3d(40, 0, 0);  // right knee, found wrongly
  pose.x_in_world(0, 18) = std::numeric_limits<double>::quiet_NaN();
  const Coco19Pose out = NormaliseScale(pose, trained, 1);
  EXPECT_FALSE(out.valid[4]);
  EXPECT_TRUE(out.valid[5]);
  EXPECT_NEAR((out.x_in_world.col(5) - whole.x_in_world.col(5)).norm(), 0, 1e-9);
  EXPECT_FALSE(out.valid[13]);
  EXPECT_FALSE(out.valid[18]);
  EXPECT_TRUE(out.valid[14]);
  Coco19Pose rootless = Mannequin(0.2);
  rootless.valid[2] = false;
  EXPECT_NEAR((NormaliseScale(rootless, trained, 2).x_in_world.col(6) - 2 * rootless.x_in_world.col(6)).norm(), 0, 1e-12);
  Coco19Pose nobody;
  EXPECT_THAT(MessageOf<FormatError>([&] { SizeRatio(trained, MeasureSkeleton({nobody}), "take.json"); }),
              HasSubstr("take.json"));
}

TEST(PoseTrack, ReadsScenesAndTheirRate) {
  const TemporaryFolder folder("pose_track");
  for (int f = 0; f < 4; ++f) {
    const std::string name = Format("/hdPose3d_stage1_coco19/body3DScene_%08d.json", 10 + 2 * f);
    MakeFolder(folder.path() + "/hdPose3d_stage1_coco19");
    std::map<int, Coco19Pose> people = {{3, Mannequin(0.1 * f)}};
    if (f == 0) people[1] = Mannequin(1);
    dataset::WriteBody3dScene(people, 500.0 + f * 1000.0 / 12.5, folder.path() + name);
  }
  const std::string scenes = folder.path() + "/hdPose3d_stage1_coco19";
  const PoseTrack track = ReadPoseTrack(scenes, -1);
  EXPECT_EQ(track.frames, (std::vector<int>{10, 12, 14, 16})) << "person 3 has most frames";
  EXPECT_NEAR(track.rate_hz, 25, 1e-9) << "two frame numbers in 80 ms";
  EXPECT_NEAR((track.poses[2].x_in_world - Mannequin(0.2).x_in_world).cwiseAbs().maxCoeff(), 0, 1e-9);
  EXPECT_EQ(ReadPoseTrack(folder.path(), 3).frames, track.frames) << "the sequence's root";
  EXPECT_EQ(ReadPoseTrack(scenes + "/body3DScene_00000010.json", 1).frames, std::vector<int>{10});
  EXPECT_EQ(SelectFrames(track, {}, 2).frames, (std::vector<int>{10, 14}));
  EXPECT_NEAR(SelectFrames(track, {}, 2).rate_hz, 25, 1e-9) << "of frame numbers, whichever are taken";
  EXPECT_EQ(UsualStep(track.frames), 2);
  EXPECT_EQ(UsualStep({10, 11, 12, 40, 41}), 1);
  EXPECT_EQ(UsualStep({7}), 1);
  EXPECT_THAT(MessageOf<NothingLeftError>([&] { SelectFrames(track, {11}, 1); }),
              AllOf(HasSubstr("frame 11"), HasSubstr("10 to 16")));
  EXPECT_THAT(MessageOf<UsageError>([&] { ReadPoseTrack(scenes, 7); }), HasSubstr("1, 3"));
  EXPECT_THAT(MessageOf<IoError>([&] { ReadPoseTrack(folder.path() + "/none", -1); }), HasSubstr("none"));
  MakeFolder(folder.path() + "/empty");
  EXPECT_THAT(MessageOf<IoError>([&] { ReadPoseTrack(folder.path() + "/empty", -1); }), HasSubstr("body3DScene"));
}

// Two bones: a root that is turned by channels in the order Z, X, Y and carries a joint.
constexpr char kSmall[] =
    "HIERARCHY\nROOT Hips\n{\n OFFSET 1 2 3\n CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation\n"
    " JOINT Left Arm\n {\n  OFFSET 0 5 0\n  CHANNELS 3 Zrotation Xrotation Yrotation\n  End Site\n  {\n   OFFSET 0 1 0\n  }\n "
    "}\n}\n"
    "MOTION\nFrames: 2\nFrame Time: 0.04\n10 20 30 90 0 0 0 0 0\n10 20 30 0 90 90 0 0 0\n";

TEST(Bvh, PlacesJointsAsTheFormulaSays) {
  const BvhClip clip = BvhFromText(kSmall, "small.bvh");
  ASSERT_EQ(clip.joints.size(), 2u);
  EXPECT_EQ(clip.joints[1].name, "Left Arm");
  EXPECT_EQ(clip.num_frames, 2);
  EXPECT_EQ(PlaceJoints(clip, -1).place[1], Eigen::Vector3d(1, 7, 3)) << "rest: offsets alone";
  EXPECT_LT((PlaceJoints(clip, 0).place[1] - Eigen::Vector3d(5, 20, 30)).norm(), 1e-12) << "Rz(90) takes +y to -x";
  EXPECT_LT((PlaceJoints(clip, 1).place[1] - Eigen::Vector3d(10, 20, 35)).norm(), 1e-12) << "Rx(90) Ry(90) takes +y to +z";
}

TEST(Bvh, DamageIsNamedWithItsLine) {
  const std::string good = kSmall;
  const auto message = [](const std::string& text) { return MessageOf<FormatError>([&] { BvhFromText(text, "x.bvh"); }); };
  EXPECT_THAT(message(good.substr(0, good.size() - 6)), AllOf(HasSubstr("x.bvh"), HasSubstr("cut off")));
  EXPECT_THAT(message(good + "7\n"), HasSubstr("more numbers"));
  std::string bad = good;
  bad.replace(bad.find("90 0 0 0"), 2, "nx");
  EXPECT_THAT(message(bad), AllOf(HasSubstr("line 19"), HasSubstr("'nx'")));
  EXPECT_THAT(message(""), HasSubstr("ends too early"));
  std::string deep = "HIERARCHY\nROOT a\n{\n";
  for (int i = 0; i < 5000; ++i) deep += "OFFSET 0 0 0\nCHANNELS 0\nJOINT b\n{\n";
  EXPECT_THAT(message(deep), HasSubstr("1024 joints"));
  EXPECT_THAT(MessageOf<FormatError>([&] { PosesFromBvh(BvhFromText(good, "x.bvh"), {}, "x.bvh"); }),
              AllOf(HasSubstr("x.bvh"), HasSubstr("LElbow")));
}

TEST(Bvh, NamesOfCommonRigsAreUnderstood) {
  const auto match = [](const std::vector<std::string>& names) {
    BvhClip clip;
    for (const std::string& name : names) clip.joints.push_back({name, -1, {}, {}});
    return MatchJoints(clip);
  };
  const auto mixamo =
      match({"mixamorig:Hips", "mixamorig:Neck", "mixamorig:LeftShoulder", "mixamorig:LeftArm", "mixamorig:LeftForeArm",
             "mixamorig:LeftHand", "mixamorig:RightUpLeg", "mixamorig:RightLeg", "mixamorig:RightFoot"});
  EXPECT_EQ(mixamo[0], 1);
  EXPECT_EQ(mixamo[3], 3) << "the arm begins at LeftArm; LeftShoulder is the collar bone";
  EXPECT_EQ(mixamo[4], 4);
  EXPECT_EQ(mixamo[5], 5);
  EXPECT_EQ(mixamo[12], 6);
  EXPECT_EQ(mixamo[13], 7);
  EXPECT_EQ(mixamo[14], 8);
  EXPECT_EQ(mixamo[2], -1) << "the hips' root is not the middle of the hip joints";
  const auto blender = match({"upper_arm.L", "forearm.L", "hand.L", "thigh.R", "shin.R", "foot.R"});
  EXPECT_EQ(blender[3], 0);
  EXPECT_EQ(blender[4], 1);
  EXPECT_EQ(blender[12], 3);
  EXPECT_EQ(blender[13], 4);
  const auto own = match({"MidHip", "Neck", "Nose", "LEye", "LEar", "LShoulder", "LElbow", "RAnkle"});
  EXPECT_EQ(own[2], 0);
  EXPECT_EQ(own[1], 2);
  EXPECT_EQ(own[15], 3);
  EXPECT_EQ(own[16], 4);
  EXPECT_EQ(own[3], 5);
  EXPECT_EQ(own[14], 7);
}

TEST(Bvh, RealClipsBecomePeopleWhoStandUpright) {
  MVS_NEEDS_DATA("bvh");
  const SkeletonSize trained = MeasureSkeleton(Swing());
  const HeadShape head = MeasureHead(Swing());
  for (const char* name : {"dab", "jumping", "jumping_jacks", "wave_hello", "zombie"}) {
    const std::string path = mvstudio::testing::DataRoot() + "/bvh/" + name + ".bvh";
    PoseTrack track = PosesFromBvh(ReadBvh(path), head, path);
    ASSERT_GT(track.poses.size(), 50u) << name;
    EXPECT_GT(track.rate_hz, 20);
    const double ratio = SizeRatio(trained, MeasureSkeleton(track.poses), path);
    for (Coco19Pose& pose : track.poses) {
      pose = NormaliseScale(pose, trained, ratio);
      for (const bool valid : pose.valid) EXPECT_TRUE(valid) << name;
    }
    const Coco19Pose& first = track.poses[0];
    EXPECT_GT(first.x_in_world(2, 1), first.x_in_world(2, 0)) << name << ": the nose is above the neck";
    EXPECT_GT(first.x_in_world(2, 0), first.x_in_world(2, 2) + 0.3) << name << ": the neck is above the hips";
    EXPECT_GT(first.x_in_world(2, 2), first.x_in_world(2, 8) + 0.5) << name << ": the hips are above the ankles";
    const Eigen::Vector3d left = first.x_in_world.col(6) - first.x_in_world.col(12),
                          up = first.x_in_world.col(0) - first.x_in_world.col(2);
    const Eigen::Vector3d nose = first.x_in_world.col(1) - (first.x_in_world.col(16) + first.x_in_world.col(18)) / 2;
    EXPECT_GT(left.cross(up).normalized().dot(nose.normalized()), 0.6) << name << ": the nose points where the body faces";
  }
}

TEST(MeasureHead, IsTheMannequinsOwn) {
  const HeadShape head = MeasureHead(Swing());
  const Coco19Pose rest = Mannequin(0);
  EXPECT_NEAR(head.trunk_m, (rest.x_in_world.col(0) - rest.x_in_world.col(2)).norm(), 1e-9);
  EXPECT_NEAR(head.offset_m[0].norm(), (rest.x_in_world.col(1) - rest.x_in_world.col(0)).norm(), 1e-9) << "nose";
  EXPECT_NEAR((head.offset_m[2] - head.offset_m[4]).norm(), (rest.x_in_world.col(16) - rest.x_in_world.col(18)).norm(), 1e-9)
      << "ears";
  EXPECT_GT(head.offset_m[0].z(), 0) << "the nose is in front";
  EXPECT_GT(head.offset_m[2].x(), 0) << "the left ear is on the left";
}

TEST(Backdrop, IsTheFormulaForEveryOpacity) {
  Image premultiplied(3, 1, 4);
  const uint8_t values[] = {0, 0, 0, 0, 60, 30, 10, 128, 200, 100, 50, 255};
  premultiplied.pixels.assign(values, values + 12);
  const Image green = Backdrop("10,200,30").Under(premultiplied);
  ASSERT_EQ(green.channels, 3);
  for (int p = 0; p < 3; ++p) {
    const double clear = 1 - values[4 * p + 3] / 255.0;
    const double back[] = {10, 200, 30};
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(green.Pixel(p, 0)[k], values[4 * p + k] + clear * back[k], 0.5) << p << k;
  }
  const Image plain = Backdrop("none").Under(premultiplied);
  ASSERT_EQ(plain.channels, 4);
  EXPECT_NEAR(plain.Pixel(1, 0)[0], 60 * 255.0 / 128, 0.5);
  EXPECT_EQ(plain.Pixel(1, 0)[3], 128);
  EXPECT_EQ(Backdrop("#1e2").Under(premultiplied).pixels[1], 0xee);
  EXPECT_EQ(Backdrop("#01a0ff").Under(premultiplied).pixels[2], 255);
  for (const char* bad : {"reddish", "300,0,0", "#12", "#12345g", "1,2", "1,2,3,4"}) {
    EXPECT_THAT(MessageOf<UsageError>([&] { Backdrop backdrop(bad); }), HasSubstr(bad)) << bad;
  }
}

TEST(Backdrop, AnImageCoversTheFrame) {
  const TemporaryFolder folder("backdrop");
  Image wide(40, 20, 3);
  for (int y = 0; y < 20; ++y) {
    for (int x = 0; x < 40; ++x)
      wide.Pixel(x, y)[0] = static_cast<uint8_t>(6 * x), wide.Pixel(x, y)[1] = static_cast<uint8_t>(12 * y);
  }
  dataset::WriteImage(wide, folder.path() + "/wide.png");
  const Image out = Backdrop(folder.path() + "/wide.png").Under(Image(10, 10, 4));
  for (int i = 0; i < 10; ++i) {
    EXPECT_NEAR(out.Pixel(i, 5)[0], 6 * (10 + 2 * i + 0.5), 0.6) << "the middle 20 columns, two each";
    EXPECT_NEAR(out.Pixel(5, i)[1], 12 * (2 * i + 0.5), 0.6);
  }
}

}  // namespace
}  // namespace mvstudio::avatar
