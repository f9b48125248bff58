// Options as INI text: what is read, what is refused, and that it comes back as it was.
#include <gtest/gtest.h>

#include "libvio/base/nearest.h"
#include "libvio/base/options.h"
#include "libvio/base/strings.h"
#include "libvio/io/text.h"
#include "tests/unit/scratch_folder.h"

namespace vio {
namespace {

struct Values {
    double gain = 0.5;
    int count = 3;
    bool on = true;
    std::string mode = "auto", file = "a.txt";

    OptionSet declared() {
        OptionSet options;
        options.section("part");
        options.add("gain", &gain, "m/s", {0, 10}, "how much");
        options.add("count", &count, "", {1, 5}, "how many");
        options.add("on", &on, "whether");
        options.section("other");
        options.add("mode", &mode, {"auto", "off"}, "how");
        options.add("file", &file, "where");
        return options;
    }
};

TEST(Options, ReadBackWhatTheyWrite) {
    const test::ScratchFolder folder;
    Values written{0.1 + 0.2, 4, false, "off", "b/c d.txt"};
    written.declared().save(folder / "x.ini");
    Values read;
    read.declared().load(folder / "x.ini");
    EXPECT_EQ(read.gain, written.gain) << "to the bit";
    EXPECT_EQ(read.count, 4);
    EXPECT_FALSE(read.on);
    EXPECT_EQ(read.mode, "off");
    EXPECT_EQ(read.file, "b/c d.txt");
}

TEST(Options, CommentsMayStandBehindValues) {
    const test::ScratchFolder folder;
    write_text(folder / "x.ini",
               "; of MRPT's kind\n[part]\ngain = 2.5 // m/s\ncount=2 ; two\non = no # never\n"
               "[other]\nfile = http://host/a;b#c  // blanks before a comment\n");
    Values read;
    read.declared().load(folder / "x.ini");
    EXPECT_EQ(read.gain, 2.5);
    EXPECT_EQ(read.count, 2);
    EXPECT_FALSE(read.on);
    EXPECT_EQ(read.file, "http://host/a;b#c");
    EXPECT_EQ(without_comment("// all of it"), "");
    EXPECT_EQ(without_comment("  1 2 3\t#x"), "1 2 3");
}

// Messages quote damaged files and yet stay one line.
TEST(InputErrors, ShowControlCharacters) {
    EXPECT_STREQ(InputError("key a\nb\r\t\x01\x7f: no number, 20 °").what(),
                 "key a\\nb\\r\\t\\x01\\x7f: no number, 20 °");
}

TEST(Options, AMisspeltNameIsToldFromAnother) {
    const std::vector<std::string> names = {"run", "render", "report", "reproduce", "simulate"};
    EXPECT_EQ(nearest("run", names), "run");
    EXPECT_EQ(nearest("rnu", names), "run");
    EXPECT_EQ(nearest("rendr", names), "render");
    EXPECT_EQ(nearest("simulates", names), "simulate");
    EXPECT_EQ(nearest("reprot", names), "report");
    EXPECT_EQ(nearest("fly", names), "");
    EXPECT_EQ(nearest("r", names), "");
    EXPECT_EQ(nearest("", names), "");
    EXPECT_EQ(nearest("run", {}), "");
}

TEST(Options, ErrorsNameFileSectionKeyAndReason) {
    const test::ScratchFolder folder;
    Values values;
    const auto error = [&](const std::string& text) {
        write_text(folder / "x.ini", text);
        return test::error_of([&] { values.declared().load(folder / "x.ini"); });
    };
    for (const auto& [text, word] : {std::pair{"[part]\ngain = 11\n", "outside its range 0 to 10"},
                                     {"[part]\ngain = 1e\n", "'1e' is not a finite number"},
                                     {"[part]\ncount = 2.5\n", "'2.5' is not an integer"},
                                     {"[part]\non = maybe\n", "neither true nor false"},
                                     {"[other]\nmode = on\n", "none of auto | off"},
                                     {"[part]\nsize = 1\n", "no such option"},
                                     {"[apart]\ngain = 1\n", "none of its sections"}}) {
        const std::string message = error(text);
        EXPECT_NE(message.find(word), std::string::npos) << message;
        EXPECT_NE(message.find("x.ini"), std::string::npos) << message;
        EXPECT_EQ(message.find('\n'), std::string::npos) << message;
    }
    EXPECT_NE(test::error_of([&] { values.declared().set("gain=1"); }).find("section.name=value"),
              std::string::npos);
}

}  // namespace
}  // namespace vio
