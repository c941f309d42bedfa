#include "avatar/body/measure/body_scores.h"

#include <cmath>
#include <limits>

#include "avatar/body/measure/known_surface.h"
#include "core/disk/files.h"
#include "core/disk/npy_write.h"
#include "core/error.h"
#include "core/format.h"
#include "tests/body/posed.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::body {
namespace {

using Members = std::vector<std::pair<std::string, std::string>>;

TexturedPerson Dancer(int num_frames) {
  TexturedPerson person;
  person.person.body = MakeMannequin(1.75, 0.3);
  person.textures = MannequinTextures(16, 3);
  const auto poses = Dance(person.person.body, num_frames);
  for (int f = 0; f < num_frames; ++f) {
    person.person.seen[f] = poses[static_cast<size_t>(f)];
    for (auto& turn : person.person.seen[f].local_rotations)  // a person's, not a knot
      turn = Eigen::Quaterniond::Identity().slerp(0.3, turn);
  }
  person.cameras = {{{0, 0}}}, person.frames = {0, 1};
  return person;
}

std::string Floats(const Eigen::MatrixXd& columns) {
  const Eigen::MatrixXf values = columns.cast<float>();
  return NpyOfFloats({static_cast<size_t>(values.cols()), static_cast<size_t>(values.rows())},
                     std::vector<float>(values.data(), values.data() + values.size()));
}

/// The truth of a person who is exactly the one given. `y_down`: in Panoptic's axes. The faces are written as quads of two
/// triangles would be, as triangles here.
void WriteTruth(const std::string& folder, const TexturedPerson& person, bool y_down,
                const std::vector<int64_t>& covered = {}) {
  const BodyTemplate& body = person.person.body;
  MakeFolder(folder);
  const auto faces = static_cast<size_t>(body.faces.cols()), bones = body.bone_names.size();
  Eigen::MatrixXd weights = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(bones), body.vertices.cols());
  for (Eigen::Index v = 0; v < body.vertices.cols(); ++v) {
    for (int k = 0; k < 4; ++k) weights(body.skin_bones(k, v), v) += body.skin_weights(k, v);
  }
  Members rest = {
      {"names", NpyOfTexts({"skin"})},
      {"skin_v", Floats(body.vertices.cast<double>())},
      {"skin_face_size", NpyOfInts({faces}, std::vector<int64_t>(faces, 3))},
      {"skin_face_v", NpyOfInts({3 * faces}, std::vector<int64_t>(body.faces.data(), body.faces.data() + 3 * faces))},
      {"skin_weights", Floats(weights)}};
  if (!covered.empty()) rest.emplace_back("skin_covered", NpyOfInts({covered.size()}, covered));
  WriteFileAtomic(folder + "/subject_rest.npz", NpzOf(rest));
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();
  if (y_down) axes << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  std::vector<double> transforms;
  for (const auto& [frame, pose] : person.person.seen) {
    const BodyPose placed = ToBodyPose(body, pose);
    for (const geometry::Rigid3& bone : placed.bone_transforms) {
      const Eigen::Matrix3d rotation = axes * bone.rotation.toRotationMatrix();
      const Eigen::Vector3d shift = axes * bone.translation;
      for (int r = 0; r < 3; ++r)
        transforms.insert(transforms.end(), {rotation(r, 0), rotation(r, 1), rotation(r, 2), shift[r]});
    }
    WriteFileAtomic(folder + Format("/vertices_%08d.npz", frame),
                    NpzOf({{"skin", Floats(axes * SkinVertices(body, placed).cast<double>())}}));
  }
  WriteFileAtomic(folder + "/motion.npz",
                  NpzOf({{"transforms", NpyOfDoubles({person.person.seen.size(), bones, 3, 4}, transforms)}}));
}

TEST(ScoreBody, TheTruthItselfHasNoError) {
  for (const bool y_down : {false, true}) {
    const TempDir folder;
    const TexturedPerson person = Dancer(4);
    WriteTruth(folder / "truth", person, y_down);
    const BodyScores scores = ScoreBody(person, KnownSurface(folder.path()), {}, {});
    EXPECT_EQ(scores.axes, y_down ? WorldAxes::kYDown : WorldAxes::kZUp);
    EXPECT_EQ(scores.mesh, "skin");
    EXPECT_FALSE(scores.sigma_z);
    ASSERT_EQ(scores.frames.size(), 4u);
    for (const BodyScore& score : scores.frames) {
      EXPECT_EQ(score.fitted, score.frame < 2);
      ASSERT_EQ(score.surface.status, Status::kOk);
      EXPECT_LT(score.surface.chamfer_m(), 1e-6);
      EXPECT_LT(score.surface.vertex_rms_m, 1e-6);
      ASSERT_TRUE(score.vertices && score.canonical_m);
      EXPECT_LT(score.vertices->mean_m, 1e-6);
      EXPECT_LT(score.vertices->procrustes_m, 1e-6);
      EXPECT_LT(*score.canonical_m, 1e-6);
    }
  }
}

TEST(ScoreBody, ABodyThatStandsAsideIsFarInTheWorldAndNearAtRest) {
  const TempDir folder;
  TexturedPerson person = Dancer(3);
  WriteTruth(folder.path(), person, false);
  for (auto& [frame, pose] : person.person.seen) pose.shift += Eigen::Vector3d(0.3, 0, -0.4);
  person.offset_sigma_m = Eigen::VectorXd::Constant(person.person.body.vertices.cols(), 0.01);
  const BodyScores scores = ScoreBody(person, KnownSurface(folder.path()), {}, {});
  for (const BodyScore& score : scores.frames) {
    EXPECT_NEAR(score.vertices->mean_m, 0.5, 1e-6);
    EXPECT_LT(score.vertices->procrustes_m, 1e-6);
    EXPECT_LT(*score.canonical_m, 1e-6);
    EXPECT_GT(score.surface.chamfer_m(), 0.05);
    EXPECT_LT(score.surface.chamfer_m(), 0.5);
  }
  EXPECT_NEAR(*scores.sigma_z, scores.frames[0].surface.vertex_rms_m / 0.01, 0.2 * *scores.sigma_z);
  // Of the two frames of the fit, each vertex once that is seen from outside.
  double square_m2 = 0;
  for (const double squared : scores.whitened) square_m2 += 1e-4 * squared / static_cast<double>(scores.whitened.size());
  EXPECT_GT(scores.whitened.size(), 1000u);
  EXPECT_LT(scores.whitened.size(), 2u * static_cast<size_t>(person.person.body.vertices.cols()));
  const double first_m = scores.frames[0].surface.vertex_rms_m, second_m = scores.frames[1].surface.vertex_rms_m;
  EXPECT_NEAR(std::sqrt(square_m2), std::sqrt((first_m * first_m + second_m * second_m) / 2), 0.02 * first_m);
}

TEST(ScoreBody, AFatterBodyIsFarAtRestToo) {
  const TempDir folder;
  TexturedPerson person = Dancer(2);
  WriteTruth(folder.path(), person, false);
  person.person.body.vertices.row(1) *= 1.1f;
  const double expected = 0.1 * person.person.body.vertices.row(1).cast<double>().cwiseAbs().mean() / 1.1;
  const BodyScores scores = ScoreBody(person, KnownSurface(folder.path()), {}, {});
  for (const BodyScore& score : scores.frames) EXPECT_NEAR(*score.canonical_m, expected, 0.1 * expected);
}

TEST(ScoreBody, OtherTopologiesAreMeasuredAsSurfaces) {
  const TempDir folder;
  TexturedPerson person = Dancer(3);
  WriteTruth(folder.path(), person, false);
  const TexturedPerson coarse = person;
  person.person.body = MakeMannequin(1.75, 0.5);
  BodyScoreOptions options;
  options.every = 2;
  const BodyScores scores = ScoreBody(person, KnownSurface(folder.path()), options, {});
  EXPECT_EQ(scores.mesh, "");
  ASSERT_EQ(scores.frames.size(), 2u);
  EXPECT_FALSE(scores.frames[0].vertices || scores.frames[0].canonical_m);
  EXPECT_LT(scores.frames[0].surface.chamfer_m(), 0.004);
  EXPECT_GT(scores.frames[0].surface.chamfer_m(), 1e-5);
  person.person.seen = {{77, person.person.seen.at(0)}};
  EXPECT_TRUE(ScoreBody(person, KnownSurface(folder.path()), {}, {}).frames.empty());
  options.every = 0;
  EXPECT_THROW(ScoreBody(coarse, KnownSurface(folder.path()), options, {}), UsageError);
}

TEST(ScoreBody, AFrameThatIsNotFiniteIsAStatus) {
  const TempDir folder;
  TexturedPerson person = Dancer(2);
  WriteTruth(folder.path(), person, false);
  Eigen::MatrixXd broken =
      SkinVertices(person.person.body, ToBodyPose(person.person.body, person.person.seen[1])).cast<double>();
  broken(2, 10) = std::numeric_limits<double>::quiet_NaN();
  WriteFileAtomic(folder / "vertices_00000001.npz", NpzOf({{"skin", Floats(broken)}}));
  const BodyScores scores = ScoreBody(person, KnownSurface(folder.path()), {}, {});
  EXPECT_EQ(scores.frames[0].surface.status, Status::kOk);
  EXPECT_EQ(scores.frames[1].surface.status, Status::kNonFiniteInput);
  EXPECT_EQ(scores.frames[1].vertices->status, Status::kNonFiniteInput);
}

TEST(KnownSurface, LeavesOutFacesThatClothCovers) {
  const TempDir folder;
  const TexturedPerson person = Dancer(1);
  const BodyTemplate& body = person.person.body;
  std::vector<int64_t> covered(static_cast<size_t>(body.vertices.cols()));
  for (Eigen::Index v = 0; v < body.vertices.cols(); ++v) covered[static_cast<size_t>(v)] = body.vertices(2, v) > 1;
  WriteTruth(folder.path(), person, false, covered);
  const KnownSurface truth(folder.path());
  TexturedPerson wide = person;  // where nobody sees it
  for (Eigen::Index v = 0; v < body.vertices.cols(); ++v)
    wide.person.body.vertices(1, v) *= covered[static_cast<size_t>(v)] ? 3 : 1;
  const BodyScores scores = ScoreBody(wide, truth, {}, {});
  ASSERT_TRUE(scores.frames[0].vertices && scores.frames[0].canonical_m);
  EXPECT_LT(scores.frames[0].vertices->mean_m, 1e-6);
  EXPECT_LT(*scores.frames[0].canonical_m, 1e-6);
  const KnownSurface::Mesh& mesh = truth.meshes()[0];
  EXPECT_EQ(mesh.bare.size(), static_cast<size_t>(std::count(covered.begin(), covered.end(), 0)));
  EXPECT_EQ(mesh.faces, body.faces);
  EXPECT_LT(mesh.outer_faces.cols(), 0.7 * mesh.faces.cols());
  for (Eigen::Index f = 0; f < mesh.outer_faces.cols(); ++f) {
    float lowest = 9;
    for (int k = 0; k < 3; ++k) lowest = std::min(lowest, body.vertices(2, mesh.outer_faces(k, f)));
    EXPECT_LE(lowest, 1.f);
  }
}

TEST(KnownSurface, FilesThatAreNoneAreNamed) {
  const TempDir folder;
  EXPECT_THAT(MessageOf<IoError>([&] { KnownSurface(folder / "none"); }), ::testing::HasSubstr("no folder"));
  EXPECT_THAT(MessageOf<IoError>([&] { KnownSurface(folder.path()); }), ::testing::HasSubstr("subject_rest.npz"));
  const TexturedPerson person = Dancer(2);
  WriteTruth(folder.path(), person, false);
  WriteFileAtomic(folder / "vertices_00000001.npz", NpzOf({{"skin", Floats(Eigen::MatrixXd::Zero(3, 5))}}));
  const KnownSurface truth(folder.path());
  EXPECT_THAT(MessageOf<FormatError>([&] { truth.Vertices(1); }), ::testing::HasSubstr("skin"));
  EXPECT_NO_THROW(truth.Vertices(0));
  for (const int64_t corner : {int64_t{-1}, int64_t{99}}) {
    WriteFileAtomic(folder / "subject_rest.npz", NpzOf({{"names", NpyOfTexts({"skin"})},
                                                        {"skin_v", Floats(Eigen::MatrixXd::Zero(3, 5))},
                                                        {"skin_face_size", NpyOfInts({1}, {3})},
                                                        {"skin_face_v", NpyOfInts({3}, {0, 1, corner})}}));
    EXPECT_THAT(MessageOf<FormatError>([&] { KnownSurface(folder.path()); }), ::testing::HasSubstr("skin_face_v"));
  }
  WriteFileAtomic(folder / "subject_rest.npz", NpzOf({{"names", NpyOfTexts({"skin"})},
                                                      {"skin_v", Floats(Eigen::MatrixXd::Zero(3, 5))},
                                                      {"skin_face_size", NpyOfInts({1}, {4})},
                                                      {"skin_face_v", NpyOfInts({3}, {0, 1, 2})}}));
  EXPECT_THAT(MessageOf<FormatError>([&] { KnownSurface(folder.path()); }), ::testing::HasSubstr("skin_face_size"));
}

}  // namespace
}  // namespace mvstudio::body
