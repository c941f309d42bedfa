#include "avatar/body/files/person_file.h"

#include <cstring>
#include <fstream>
#include <limits>

#include "core/disk/files.h"
#include "core/disk/npy_write.h"
#include "core/error.h"
#include "dataset/arrays/npz.h"
#include "tests/body/posed.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::body {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

template <class Matrix>
bool SameBits(const Matrix& a, const Matrix& b) {
  if (a.rows() != b.rows() || a.cols() != b.cols()) return false;
  return a.size() == 0 || std::memcmp(a.data(), b.data(), static_cast<size_t>(a.size()) * sizeof(typename Matrix::Scalar)) == 0;
}

void ExpectSame(const BodyTemplate& a, const BodyTemplate& b) {
  EXPECT_TRUE(SameBits(a.vertices, b.vertices));
  EXPECT_TRUE(SameBits(a.faces, b.faces));
  EXPECT_EQ(a.face_part, b.face_part);
  EXPECT_TRUE(SameBits(a.face_uv, b.face_uv));
  EXPECT_EQ(a.bone_names, b.bone_names);
  EXPECT_EQ(a.bone_roles, b.bone_roles);
  EXPECT_EQ(a.bone_parents, b.bone_parents);
  EXPECT_TRUE(SameBits(a.bone_heads, b.bone_heads));
  EXPECT_TRUE(SameBits(a.bone_tails, b.bone_tails));
  EXPECT_TRUE(SameBits(a.skin_bones, b.skin_bones));
  EXPECT_TRUE(SameBits(a.skin_weights, b.skin_weights));
  EXPECT_TRUE(SameBits(a.coco19, b.coco19));
  EXPECT_EQ(a.coco19_bone, b.coco19_bone);
  EXPECT_TRUE(SameBits(a.pose_directions, b.pose_directions));
}

TEST(PersonFile, MannequinComesBackBitForBit) {
  const TempDir folder;
  PersonFile person{MakeMannequin(1.83), {}};
  person.extras["girth"] = Eigen::MatrixXd::Random(5, 3);
  person.extras["no_rows"] = Eigen::MatrixXd(0, 4);
  person.extras["odd"] = (Eigen::MatrixXd(1, 4) << kNaN, -0.0, std::numeric_limits<double>::infinity(), 1e-310).finished();
  WritePersonFile(folder / "body.npz", person);
  const PersonFile back = ReadPersonFile(folder / "body.npz");
  ExpectSame(back.body, person.body);
  ASSERT_EQ(back.extras.size(), 3u);
  for (const auto& [name, matrix] : person.extras) EXPECT_TRUE(SameBits(back.extras.at(name), matrix)) << name;
  EXPECT_EQ(PersonFileBytes(back), ReadFile(folder / "body.npz"));
}

TEST(PersonFile, PoseDirectionsComeBackAndMustFitTheBody) {
  const TempDir folder;
  PersonFile person{MakeMannequin(1.83, 0.3), {}};
  const Eigen::Index vertices = person.body.vertices.cols();
  const auto turns = 9 * (static_cast<Eigen::Index>(person.body.bone_names.size()) - 1);
  person.body.pose_directions = 0.01f * Eigen::MatrixXf::Random(3 * vertices, turns);
  WritePersonFile(folder / "body.npz", person);
  ExpectSame(ReadPersonFile(folder / "body.npz").body, person.body);
  const auto members = dataset::ParseNpzMembers(ReadFile(folder / "body.npz"), "body.npz");
  const NpyArray array = ParseNpy(members.at("pose_directions"), "pose_directions");
  EXPECT_EQ(array.shape, (std::vector<int64_t>{turns, vertices, 3}));
  EXPECT_EQ(static_cast<float>(array.values[3 * static_cast<size_t>(vertices) + 5]), person.body.pose_directions(5, 1));
  person.body.pose_directions.conservativeResize(3 * vertices, turns - 9);
  EXPECT_THAT(MessageOf<ContractViolation>([&] { PersonFileBytes(person); }), HasSubstr("pose_directions"));
  person.body.pose_directions = Eigen::MatrixXf::Constant(3 * vertices, turns, std::numeric_limits<float>::infinity());
  EXPECT_THAT(MessageOf<ContractViolation>([&] { PersonFileBytes(person); }), HasSubstr("not finite"));
}

TEST(PersonFile, NumpyFindsRowsPerElement) {
  const auto members =
      dataset::ParseNpzMembers(PersonFileBytes({Flag(), {{"a", Eigen::MatrixXd::Identity(2, 3)}}}), "body.npz");
  const auto shape = [&](const std::string& name) { return ParseNpy(members.at(name), name).shape; };
  using Shape = std::vector<int64_t>;
  EXPECT_EQ(shape("vertices"), (Shape{4, 3}));
  EXPECT_EQ(shape("face_uv"), (Shape{2, 3, 2}));
  EXPECT_EQ(shape("skin_weights"), (Shape{4, 4}));
  EXPECT_EQ(shape("extra.a"), (Shape{2, 3}));
  EXPECT_EQ(ParseNpy(members.at("extra.a"), "a").values, (std::vector<double>{1, 0, 0, 0, 1, 0}));
  EXPECT_EQ(ParseNpy(members.at("faces"), "faces").values, (std::vector<double>{0, 1, 2, 0, 2, 3}));
}

TEST(PersonFile, ReplacesOnlyItsOwnFiles) {
  const TempDir folder;
  WritePersonFile(folder / "body.npz", {Flag(), {}});
  WritePersonFile(folder / "body.npz", {Flag(), {}});
  std::ofstream(folder / "mine.npz") << "mine";
  EXPECT_THROW(WritePersonFile(folder / "mine.npz", {Flag(), {}}), UsageError);
}

/// Message for a flag whose array `name` has other bytes; none: the array is left out.
std::string Refusal(const std::string& name, const std::string& npy) {
  auto members = dataset::ParseNpzMembers(PersonFileBytes({Flag(), {}}), "body.npz");
  members[name] = npy;
  std::vector<std::pair<std::string, std::string>> list;
  for (const auto& member : members) {
    if (!member.second.empty()) list.push_back(member);
  }
  return MessageOf<FormatError>([&] { ParsePersonFile(NpzOf(list), "body.npz"); });
}

TEST(PersonFile, EveryArrayHasToBeThere) {
  for (const auto& [name, bytes] : dataset::ParseNpzMembers(PersonFileBytes({Flag(), {}}), "body.npz")) {
    EXPECT_THAT(Refusal(name, ""), HasSubstr("body.npz: " + name + ": is missing"));
    EXPECT_THAT(Refusal(name, "no array"), HasSubstr("body.npz: " + name + ": byte 0"));
    EXPECT_THAT(Refusal(name, bytes.substr(0, bytes.size() - 1)), HasSubstr("body.npz: " + name + ": shape"));
  }
}

TEST(PersonFile, RefusesWrongShapes) {
  const std::string scalar = NpyOfDoubles({}, {1});
  for (const char* name : {"vertices", "faces", "face_part", "face_uv", "bone_roles", "bone_parents", "bone_heads",
                           "bone_tails", "skin_bones", "skin_weights", "coco19", "coco19_bone"}) {
    EXPECT_THAT(Refusal(name, scalar), HasSubstr(std::string("body.npz: ") + name + ": has another shape")) << name;
    EXPECT_THAT(Refusal(name, NpyOfDoubles({2, 2, 2}, std::vector<double>(8))), HasSubstr(name)) << name;
  }
  EXPECT_THAT(Refusal("vertices", NpyOfDoubles({0, 3}, {})), HasSubstr("vertices: is empty"));
  EXPECT_THAT(Refusal("faces", NpyOfInts({0, 3}, {})), HasSubstr("faces: is empty"));
  EXPECT_THAT(Refusal("face_part", NpyOfInts({3}, {1, 1, 1})), HasSubstr("face_part: has 3 rows, not 2"));
  EXPECT_THAT(Refusal("bone_heads", NpyOfDoubles({1, 3}, {0, 0, 0})), HasSubstr("bone_heads: has 1 rows, not 2"));
  EXPECT_THAT(Refusal("coco19_bone", NpyOfInts({18}, std::vector<int64_t>(18))), HasSubstr("coco19_bone: has another shape"));
}

TEST(PersonFile, RefusesWrongIndices) {
  EXPECT_THAT(Refusal("faces", NpyOfInts({2, 3}, {0, 1, 4, 0, 1, 2})), HasSubstr("faces: row 0 has the vertex 4"));
  EXPECT_THAT(Refusal("faces", NpyOfInts({2, 3}, {0, 1, 2, 0, -1, 2})), HasSubstr("faces: row 1 has the vertex -1"));
  EXPECT_THAT(Refusal("faces", NpyOfDoubles({2, 3}, {0, 1, 2, 0, 0.5, 2})),
              HasSubstr("faces: holds a number that is not whole"));
  EXPECT_THAT(Refusal("faces", NpyOfInts({2, 3}, {0, 1, 2, 0, 1, int64_t{1} << 32})), HasSubstr("faces: holds a number"));
  EXPECT_THAT(Refusal("face_part", NpyOfInts({2}, {1, 25})), HasSubstr("face_part: row 1 has the part 25"));
  EXPECT_THAT(Refusal("face_part", NpyOfInts({2}, {0, 2})), HasSubstr("face_part: row 0 has the part 0"));
  EXPECT_THAT(Refusal("bone_roles", NpyOfInts({2}, {1, kNumBoneRoles})), HasSubstr("bone_roles: has the role 20"));
  EXPECT_THAT(Refusal("bone_roles", NpyOfInts({2}, {-1, 0})), HasSubstr("bone_roles: has the role -1"));
  EXPECT_THAT(Refusal("bone_parents", NpyOfInts({2}, {-1, 1})), HasSubstr("bone_parents: row 1 has the parent 1"));
  EXPECT_THAT(Refusal("bone_parents", NpyOfInts({2}, {-1, -1})), HasSubstr("bone_parents: row 1 has the parent -1"));
  EXPECT_THAT(Refusal("bone_parents", NpyOfInts({2}, {0, 0})), HasSubstr("bone_parents: does not begin with the root"));
  EXPECT_THAT(Refusal("skin_bones", NpyOfInts({4, 4}, std::vector<int64_t>(16, 2))),
              HasSubstr("skin_bones: row 0 has the bone 2"));
  EXPECT_THAT(Refusal("coco19_bone", NpyOfInts({19}, std::vector<int64_t>(19, -1))), HasSubstr("coco19_bone: row 0"));
}

TEST(PersonFile, RefusesWrongNumbers) {
  std::vector<double> places(12, 0.5), uv(12, 0.5), weights(16, 0.25);
  places[7] = kNaN;
  EXPECT_THAT(Refusal("vertices", NpyOfDoubles({4, 3}, places)), HasSubstr("vertices: holds a number that is not finite"));
  places[7] = 1e300;
  EXPECT_THAT(Refusal("vertices", NpyOfDoubles({4, 3}, places)), HasSubstr("vertices: holds a number that is not finite"));
  uv[11] = 1.5;
  EXPECT_THAT(Refusal("face_uv", NpyOfDoubles({2, 3, 2}, uv)), HasSubstr("face_uv: row 1 leaves [0, 1]"));
  weights[5] = 0.3;
  EXPECT_THAT(Refusal("skin_weights", NpyOfDoubles({4, 4}, weights)), HasSubstr("skin_weights: row 1 does not sum to 1"));
  weights[5] = -0.25, weights[6] = 0.75;
  EXPECT_THAT(Refusal("skin_weights", NpyOfDoubles({4, 4}, weights)), HasSubstr("skin_weights: row 1 has a weight below 0"));
  const std::string endless = NpyOfDoubles({2, 3}, std::vector<double>(6, std::numeric_limits<double>::infinity()));
  EXPECT_THAT(Refusal("bone_heads", endless), HasSubstr("bone_heads: holds a number"));
  EXPECT_THAT(Refusal("bone_tails", endless), HasSubstr("bone_tails: holds a number"));
  EXPECT_THAT(Refusal("coco19", NpyOfDoubles({19, 3}, std::vector<double>(57, kNaN))), HasSubstr("coco19: holds a number"));
}

TEST(PersonFile, RefusesWrongTexts) {
  EXPECT_THAT(Refusal("schema", NpyOfTexts({"mvstudio.body/9"})), HasSubstr("schema: is not 'mvstudio.body/1'"));
  EXPECT_THAT(Refusal("bone_names", NpyOfTexts({"a", "a"})), HasSubstr("bone_names: has two bones called 'a'"));
  EXPECT_THAT(Refusal("bone_names", NpyOfTexts({"a", ""})), HasSubstr("bone_names: a name is empty"));
  EXPECT_THAT(Refusal("bone_names", NpyOfTexts({"a", "b\nc"})), HasSubstr("bone_names: a name holds a control character"));
  EXPECT_THAT(Refusal("bone_names", NpyOfTexts({})), HasSubstr("bone_names: is empty"));
  EXPECT_THAT(Refusal("bone_names", NpyOfInts({2}, {1, 2})), HasSubstr("bone_names: descr"));
  EXPECT_THAT(Refusal("bone_names", NpyOfTexts({"a"})), HasSubstr("has 2 rows, not 1"));
}

TEST(PersonFile, RefusesArraysThatItDoesNotKnow) {
  EXPECT_THAT(Refusal("colour", NpyOfInts({1}, {1})), HasSubstr("colour: is not known"));
  EXPECT_THAT(Refusal("extra.", NpyOfInts({1}, {1})), HasSubstr("extra.: is not known"));
  EXPECT_THAT(Refusal("extra.a b", NpyOfInts({1}, {1})), HasSubstr("extra.a b: is not known"));
  EXPECT_THAT(Refusal("extra.a", NpyOfInts({1}, {1})), HasSubstr("extra.a: is no matrix"));
  EXPECT_THAT(Refusal("extra.a", NpyOfTexts({"a"})), HasSubstr("extra.a: descr"));
}

TEST(PersonFile, RefusesWhatIsCutShort) {
  const std::string bytes = PersonFileBytes({Flag(), {}});
  for (size_t size = 0; size < bytes.size(); size += 7) {
    EXPECT_THROW(ParsePersonFile(bytes.substr(0, size), "body.npz"), FormatError) << size;
  }
}

TEST(PersonFile, WritesNothingThatItWouldRefuse) {
  const TempDir folder;
  PersonFile person{Flag(), {}};
  person.body.skin_weights(0, 0) = 0.5f;
  EXPECT_THAT(MessageOf<ContractViolation>([&] { WritePersonFile(folder / "body.npz", person); }),
              HasSubstr("skin_weights: row 0 does not sum to 1"));
  person.body = Flag(), person.body.vertices(1, 2) = static_cast<float>(kNaN);
  EXPECT_THAT(MessageOf<ContractViolation>([&] { PersonFileBytes(person); }),
              HasSubstr("vertices: row 2 holds a number that is not finite"));
  person.body = Flag(), person.extras["a/b"] = Eigen::MatrixXd::Zero(1, 1);
  EXPECT_THROW(PersonFileBytes(person), ContractViolation);
  EXPECT_THROW(ReadPersonFile(folder / "body.npz"), IoError);
}

}  // namespace
}  // namespace mvstudio::body
