#include "avatar/maps/bones.h"

#include <ATen/ATen.h>

#include <algorithm>
#include <set>

#include "avatar/run/pack/joint_source.h"
#include "avatar/train/train.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "core/random.h"
#include "dataset/panoptic/panoptic_files.h"
#include "geometry/skeleton/skeleton.h"
#include "tests/avatar/panoptic_fixture.h"
#include "tests/avatar/synthetic_pack.h"
#include "tests/support/test.h"

namespace mvstudio::avatar {
namespace {

constexpr DepthRange kRange = {-0.5, 0.5};

struct Joints {
  explicit Joints(int64_t count)
      : px(at::full({1, count, 2}, -1000.0)), depth(at::zeros({1, count})), valid(at::zeros({1, count}, at::kBool)) {}
  void Set(int64_t j, double x, double y, double z) { px[0][j][0] = x, px[0][j][1] = y, depth[0][j] = z, valid[0][j] = true; }
  at::Tensor px, depth, valid;
};

double ValueOf(double depth) { return -0.8 + 1.8 * (depth + 0.5); }

TEST(InputMaps, HaveTheirNumbersAndOnlyTheirOwnJoints) {
  for (const auto& [inputs, joints, maps] :
       {std::tuple{18, 19, 18}, {21, 131, 21}, {24, 25, 24}, {27, 137, 27}, {36, 19, 18}}) {
    const InputLayout& layout = LayoutOf(inputs);
    EXPECT_EQ(layout.num_joints, joints) << inputs;
    EXPECT_EQ(static_cast<int>(layout.maps.size()), maps) << inputs;
    EXPECT_EQ(layout.slopes, inputs == 36);
    for (const InputMap& map : layout.maps) {
      EXPECT_EQ(map.thin, map.lines.size() > 1) << map.name;
      for (const BoneLine& line : map.lines) {
        for (const int j : line.needs) EXPECT_LT(j, joints) << map.name;
      }
    }
  }
  EXPECT_EQ(LayoutOf(27).maps[24].lines.size(), 20u) << "five fingers of four bones";
  EXPECT_THROW(LayoutOf(20), UsageError);
}

TEST(InputMaps, Body25sBonesAreThoseOfTheSkeleton) {
  const geometry::Skeleton& whole = geometry::SkeletonByName("openpose137");
  std::set<std::pair<int, int>> known;
  for (const auto& [a, b] : whole.bones) known.insert(std::minmax(a, b));
  for (const InputMap& map : LayoutOf(27).maps) {
    for (const BoneLine& line : map.lines) {
      EXPECT_TRUE(known.count(std::minmax(line.a, line.b)))
          << map.name << ": " << whole.joints[line.a] << " to " << whole.joints[line.b];
    }
  }
  const InputMap &left = LayoutOf(27).maps[24], &right = LayoutOf(27).maps[25];
  EXPECT_EQ(whole.joints[left.lines[0].a], "LHandWrist");
  EXPECT_EQ(whole.joints[left.lines[3].b], "LThumb4");
  EXPECT_EQ(whole.joints[right.lines[19].b], "RPinky4");
}

TEST(InputMaps, ValuesAreTheClosedForm) {
  Joints body(25);
  body.Set(1, 10, 20, -0.2), body.Set(8, 30, 20, 0.3);  // bone 5: neck to the middle of the hips
  const at::Tensor maps = RasterizeMaps(LayoutOf(24).maps, body.px, body.depth, body.valid, 40, 48, 2.0, kRange)[0];
  ASSERT_EQ(maps.sizes(), at::IntArrayRef({24, 40, 48}));
  for (int x = 10; x <= 30; ++x) {
    const double full = ValueOf(-0.2 + 0.5 * (x - 10) / 20);
    EXPECT_NEAR(maps[5][20][x].item<double>(), full, 1e-5) << x;
    EXPECT_NEAR(maps[5][22][x].item<double>(), full, 1e-5) << "2 px beside the line is inside";
    EXPECT_NEAR(maps[5][23][x].item<double>(), -1, 1e-5) << "3 px beside it is the end of the ramp";
  }
  EXPECT_NEAR(maps[5][20][8].item<double>(), ValueOf(-0.2), 1e-5) << "the cap";
  for (int k = 0; k < 24; ++k) {
    if (k == 5) continue;
    EXPECT_EQ(maps[k].max().item<double>(), -1.0) << k;
  }
}

TEST(InputMaps, FingersAreThinAndNeedFiveJoints) {
  Joints all(137);
  const int wrist = 25 + 70;  // left hand
  all.Set(wrist, 10, 10, 0);
  for (int k = 1; k <= 4; ++k) all.Set(wrist + k, 10 + 5 * k, 10, 0.1 * k);        // thumb
  for (int k = 5; k <= 7; ++k) all.Set(wrist + k, 10, 10 + 5 * (k - 4), 0.1 * k);  // index without its tip
  const at::Tensor maps = RasterizeMaps(LayoutOf(27).maps, all.px, all.depth, all.valid, 40, 40, 3.0, kRange)[0];
  EXPECT_NEAR(maps[24][10][15].item<double>(), ValueOf(0.1), 1e-5) << "a knuckle has its own depth";
  EXPECT_NEAR(maps[24][10][13].item<double>(), ValueOf(0.06), 1e-5) << "linear between them";
  EXPECT_NEAR(maps[24][11][20].item<double>(), ValueOf(0.2), 1e-5);
  EXPECT_NEAR(maps[24][12][20].item<double>(), -1 + 0.5 * (ValueOf(0.2) + 1), 1e-5) << "half of 3 px and half of the ramp";
  EXPECT_EQ(maps[24][13][20].item<double>(), -1.0);
  EXPECT_EQ(maps[24][25][10].item<double>(), -1.0) << "the index finger lacks a joint";
  EXPECT_EQ(maps[25].max().item<double>(), -1.0) << "no right hand";
  EXPECT_EQ(maps[26].max().item<double>(), -1.0) << "no face";
}

TEST(InputMaps, LoopsAndTensorsAgreeForEveryList) {
  Rng random(4);
  for (const auto& [inputs, count] : {std::pair{18, 19}, {18, 131}, {21, 131}, {21, 19}, {24, 25}, {27, 137}, {27, 25}}) {
    at::Tensor px = at::zeros({2, count, 2}), depth = at::zeros({2, count}), valid = at::ones({2, count}, at::kBool);
    for (int64_t i = 0; i < 2 * count; ++i) {
      px.data_ptr<float>()[2 * i] = static_cast<float>(random.Uniform(-15, 60));
      px.data_ptr<float>()[2 * i + 1] = static_cast<float>(random.Uniform(-15, 60));
      depth.data_ptr<float>()[i] = static_cast<float>(random.Uniform(-0.7, 0.7));
      valid.data_ptr<bool>()[i] = random.Uniform(0, 1) < 0.95;
    }
    for (const double half_width : {1.0, 2.7}) {
      const at::Tensor loops = RasterizeMaps(LayoutOf(inputs).maps, px, depth, valid, 48, 40, half_width, kRange);
      const at::Tensor tensors = RasterizeMapsTensor(LayoutOf(inputs).maps, px, depth, valid, 48, 40, half_width, kRange);
      EXPECT_LT((loops - tensors).abs().max().item<double>(), 2e-4) << inputs << " " << count;
      if ((inputs == 21 && count == 19) || (inputs == 27 && count == 25)) {
        EXPECT_EQ(loops.slice(1, inputs - 3).max().item<double>(), -1.0) << "no hands and no face: background";
      }
    }
  }
}

/// A synthetic pack whose people have hands: fingers of 3 cm bones from the wrists downwards, a small round face.
AvatarPack WithHands(const AvatarPack& pack) {
  AvatarPack out = pack;
  out.joints_in_cam = at::zeros({pack.size(), 131, 3}), out.joint_valid = at::ones({pack.size(), 131}, at::kBool);
  out.joints_in_cam.slice(1, 0, 19) = pack.joints_in_cam;
  for (int side = 0; side < 2; ++side) {
    const int first = 19 + 70 + 21 * side, wrist = side == 0 ? 5 : 11;
    for (int k = 0; k < 21; ++k) {
      const double spread = k == 0 ? 0 : 0.02 * ((k - 1) / 4 - 2), reach = k == 0 ? 0 : 0.03 * ((k - 1) % 4 + 1);
      out.joints_in_cam.select(1, first + k) =
          pack.joints_in_cam.select(1, wrist) + at::tensor({spread, reach, 0.0}, at::kFloat);
    }
  }
  for (int k = 0; k < 70; ++k) {
    const at::Tensor offset = at::tensor({0.05 * std::sin(0.09 * k), 0.05 * std::cos(0.09 * k), 0.0}, at::kFloat);
    out.joints_in_cam.select(1, 19 + k) = pack.joints_in_cam.select(1, 1) + offset;
  }
  return out;
}

TEST(InputMaps, ANetworkOfTwentyOneInputsLearnsFromHandsAndItsPackSurvivesTheDisk) {
  const AvatarPack pack = WithHands(MakeSyntheticPack(4, 32, 5));
  const TemporaryFolder folder("bones_pack");
  SavePack(pack, folder.path() + "/pack.safetensors");
  const AvatarPack loaded = LoadPack(folder.path() + "/pack.safetensors");
  EXPECT_TRUE(at::equal(loaded.joints_in_cam, pack.joints_in_cam));
  ModelOptions model;
  model.width = 4, model.downs = 2, model.encoder_blocks = model.decoder_blocks = 1, model.texture_px = 8, model.inputs = 21;
  TrainOptions options;
  options.steps = 15, options.init_steps = 5, options.report_every = 1, options.validate_images = 0;
  Trainer trainer(loaded, model, options, {});
  double first = 0, last = 0;
  const TrainReport report = trainer.Run(nullptr, [&](int64_t step, const HistoryRow* row) {
    if (row && step == 6) first = (*row)["total"];
    if (row && step > 6) last = (*row)["total"];
    return true;
  });
  EXPECT_EQ(report.status, Status::kOk);
  EXPECT_EQ(trainer.model().step, 20);
  EXPECT_LT(last, first);
  const at::Tensor px = ProjectPinhole(pack.intrinsics, pack.joints_in_cam);
  const at::Tensor maps = NetworkInput(trainer.model(), pack.joints_in_cam, pack.joint_valid, px, 32, 32);
  EXPECT_EQ(maps.sizes(), at::IntArrayRef({4, 21, 32, 32}));
  for (int k = 18; k < 21; ++k) EXPECT_GT(maps.select(1, k).max().item<double>(), -0.5) << "hands and face are drawn";
  const TensorFile file = ModelToTensors(trainer.model());
  EXPECT_EQ(ModelFromTensors(file, "test").options.inputs, 21);
  AvatarPack wrong = pack;
  wrong.joints_in_cam = pack.joints_in_cam.slice(1, 0, 20).contiguous(),
  wrong.joint_valid = pack.joint_valid.slice(1, 0, 20).contiguous();
  EXPECT_THROW(Validate(wrong), ContractViolation);
  model.inputs = 24;
  EXPECT_THROW(Trainer(pack, model, options, {}), UsageError);
}

dataset::Coco19Pose Standing() {
  const body::BodyTemplate body = body::MakeMannequin(1.75, 0.3);
  dataset::Coco19Pose pose;
  pose.x_in_world = body::PosedCoco19(body, SwingPose(body, 0.3));
  pose.valid.fill(true), pose.confidence.fill(1);
  return pose;
}

TEST(JointSource, NineteenJointsBecomeBody25ByName) {
  dataset::Coco19Pose pose = Standing();
  pose.valid[16] = false;  // left ear
  const FullPose full = BodyAlone(pose, 25);
  const geometry::Skeleton& body25 = geometry::SkeletonByName("body25");
  int known = 0;
  for (int j = 0; j < 25; ++j) {
    const int from = geometry::Coco19().Find(body25.joints[j]);
    EXPECT_EQ(full.valid[j], from >= 0 && pose.valid[from]) << body25.joints[j];
    if (!full.valid[j]) continue;
    EXPECT_EQ(full.x_in_world.col(j), pose.x_in_world.col(from)) << body25.joints[j];
    ++known;
  }
  EXPECT_EQ(known, 18);
  // All bones that have both ends are drawn; toes, heels and the missing ear are not.
  at::Tensor px = at::zeros({1, 25, 2}), valid = at::zeros({1, 25}, at::kBool);
  for (int j = 0; j < 25; ++j) {
    px[0][j][0] = 32 + 25 * full.x_in_world(0, j), px[0][j][1] = 60 - 30 * full.x_in_world(2, j);
    valid[0][j] = static_cast<bool>(full.valid[j]);
  }
  const at::Tensor maps = RasterizeMaps(LayoutOf(24).maps, px, at::zeros({1, 25}), valid, 64, 64, 1.0, kRange)[0];
  for (int k = 0; k < 24; ++k) {
    const BoneLine& line = LayoutOf(24).maps[k].lines[0];
    EXPECT_EQ(maps[k].max().item<double>() > -1, full.valid[line.a] && full.valid[line.b]) << k;
  }
}

dataset::PanopticLandmarks PointsAround(const Eigen::Vector3d& x_in_world, int count) {
  dataset::PanopticLandmarks points;
  points.average_score.emplace();
  for (int k = 0; k < count; ++k) {
    const Eigen::Vector3d x = x_in_world + Eigen::Vector3d(0.001 * k, 0.02, -0.03);
    points.landmarks_cm.insert(points.landmarks_cm.end(), {100 * x.x(), -100 * x.z(), 100 * x.y()});
    points.average_score->push_back(k == 3 ? 0.01 : 0.7);
  }
  return points;
}

TEST(JointSource, ReadsHandsAndFacesOfPanopticAndTablesOfTriangulation) {
  const TemporaryFolder folder("joint_source");
  WriteMannequinDataset(folder.path() + "/d", 2, 2, 32);
  const dataset::PanopticDataset data = dataset::OpenPanopticDataset(folder.path() + "/d");
  const dataset::Coco19Pose& pose = data.poses.at(1).at(0);
  dataset::PanopticLandmarkPerson person;
  person.id = 0;
  person.left_hand = PointsAround(pose.x_in_world.col(5), 21);
  person.right_hand = PointsAround(pose.x_in_world.col(11) + Eigen::Vector3d(1, 0, 0), 21);  // another person's
  dataset::PanopticLandmarkFile hands;
  hands.people = {person};
  dataset::WritePanopticLandmarks(hands, data.root + "/hdHand3d/handRecon3D_hd00000001.json");
  dataset::PanopticLandmarkPerson face;
  face.id = 0;
  face.face70 = PointsAround(pose.x_in_world.col(1), 70);
  dataset::PanopticLandmarkFile faces;
  faces.people = {face};
  dataset::WritePanopticLandmarks(faces, data.root + "/hdFace3d/faceRecon3D_hd00000001.json");

  const JointSource source(data, 0, 131, "", {0, 1});
  const FullPose full = source.At(1, pose);
  const Eigen::Vector3d expected = pose.x_in_world.col(5) + Eigen::Vector3d(0.007, 0.02, -0.03);
  EXPECT_TRUE(full.valid[19 + 70 + 7]);
  EXPECT_LT((full.x_in_world.col(19 + 70 + 7) - expected).norm(), 1e-6);
  EXPECT_FALSE(full.valid[19 + 70 + 3]) << "score 0.01";
  EXPECT_FALSE(full.valid[19 + 91 + 7]) << "a metre from the wrist";
  EXPECT_TRUE(full.valid[19 + 69]);
  EXPECT_EQ(source.num_extended(), 1);
  const FullPose other = source.At(0, data.poses.at(0).at(0));
  EXPECT_EQ(std::count(other.valid.begin(), other.valid.end(), true), 19) << "no files for frame 0";

  dataset::Pose3d table;
  table.skeleton = "body25";
  const geometry::Skeleton& body25 = geometry::SkeletonByName("body25");
  const Eigen::Vector3d left = pose.x_in_world.col(8), right = pose.x_in_world.col(14), step(0.02, -0.1, -0.05);  // ankles
  const auto add = [&](const std::string& name, const Eigen::Vector3d& x_in_world) {
    dataset::JointRow row;
    row.frame = 1, row.person = 0, row.joint = name, row.status = Status::kOk, row.x_in_world = x_in_world, row.num_views = 3;
    table.rows.push_back(row);
  };
  add("LBigToe", left + step), add("RHeel", right + step), add("Nose", left), add("RBigToe", right + 5 * step);
  dataset::WritePose3d(table, folder.path() + "/pose3d");
  const FullPose toes = JointSource(data, 0, 25, folder.path() + "/pose3d", {1}).At(1, pose);
  EXPECT_TRUE(toes.valid[body25.Find("LBigToe")]);
  EXPECT_LT((toes.x_in_world.col(body25.Find("RHeel")) - right - step).norm(), 1e-6);
  EXPECT_FALSE(toes.valid[body25.Find("RBigToe")]) << "too far from its ankle";
  EXPECT_FALSE(toes.valid[body25.Find("LHeel")]);
  EXPECT_EQ(toes.x_in_world.col(0), pose.x_in_world.col(1)) << "the body's joints are the dataset's";
}

}  // namespace
}  // namespace mvstudio::avatar
