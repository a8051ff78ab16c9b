#!/usr/bin/env perl
# page.pl FILE.md: the page as Doxygen reads it. GitHub reads the page itself.
#
# - Formulas, $…$ and blocks ```math, become Doxygen's.
# - Each heading gets the name that a link on GitHub gives it, behind the page's own: docs/theory/means.md#1-features is
#   theory-means-1-features here, and the page itself theory-means. Links follow.
# - Pictures are named without their folder.
use strict;
use warnings;
use utf8;
use open qw(:std :encoding(UTF-8));

# page_name PATH: the page's label, from its path below the root or docs/.
sub page_name {
  my ($path) = @_;
  $path =~ s{^(.*/)?docs/}{} or $path =~ s{^.*/}{};
  $path =~ s{\.md$}{};
  $path =~ s{/}{-}g;
  return lc $path;
}

# resolved PATH BASE: PATH, which stands on a page in folder BASE, without its ..
sub resolved {
  my ($path, $base) = @_;
  my @parts;
  for my $part (split m{/}, "$base/$path") {
    if ($part eq '..') { pop @parts; }
    elsif ($part ne '.' && $part ne '') { push @parts, $part; }
  }
  return join '/', @parts;
}

sub slug {
  my ($heading) = @_;
  $heading = lc $heading;
  $heading =~ s/[^\p{L}\p{N} _-]//g;
  $heading =~ s/ /-/g;
  return $heading;
}

# label TEXT: as Doxygen takes it: letters, digits, _ and -.
sub label {
  my ($text) = @_;
  $text =~ s/([^A-Za-z0-9_-])/sprintf 'u%x', ord $1/ge;
  return $text;
}

my $file = shift @ARGV;
my ($folder) = $file =~ m{^(.*)/[^/]*$};
$folder = defined $folder ? $folder : '.';
my $page = page_name($file);

sub link_target {
  my ($target) = @_;
  return "]($target)" if $target =~ m{^[a-z]+:};
  if ($target =~ /\.(svg|png)$/) {
    $target =~ s{.*/}{};
    return "]($target)";
  }
  my ($path, $anchor) = split /#/, $target, 2;
  return "]($target)" if $path ne '' && $path !~ /\.md$/;
  my $name = $path eq '' ? $page : page_name(resolved($path, $folder));
  # The README is the main page, and the list of pages is the menu.
  $name = 'index' if $name eq 'readme';
  $name = 'documentation' if $name eq 'index' && $path ne '' && $path !~ /README/;
  return '](@ref ' . label(defined $anchor ? "$name-$anchor" : $name) . ')';
}

# text LINE: links and formulas of a line, without what stands in backticks.
sub text {
  my ($line) = @_;
  my $out = '';
  for my $part (split /(`+[^`]+`+)/, $line) {
    if ($part !~ /^`/) {
      $part =~ s/(?<![\\\w\$])\$(?=\S)([^\$]*?\S)\$(?![\w\$])/\\f\$$1\\f\$/g;
    }
    $out .= $part;
  }
  $out =~ s/\]\(([^() ]+)\)/link_target($1)/ge;
  return $out;
}

$page = 'documentation' if $page eq 'index';
my %seen;
my $first = 1;
my $fence = '';
open my $in, '<', $file or die "$file: $!\n";
while (my $line = <$in>) {
  chomp $line;
  if ($fence ne '') {
    if ($line =~ /^\s*```\s*$/) {
      print $fence eq 'math' ? "\\f]\n" : "$line\n";
      $fence = '';
    } else {
      print "$line\n";
    }
  } elsif ($line =~ /^\s*```math\s*$/) {
    $fence = 'math';
    print "\\f[\n";
  } elsif ($line =~ /^\s*```/) {
    $fence = 'code';
    print "$line\n";
  } elsif ($line =~ /^    / && $line !~ /\S.*\]\(/) {
    print "$line\n";
  } elsif ($line =~ /^(#+) (.*)$/) {
    my ($marks, $heading) = ($1, $2);
    my $slug = slug($heading);
    my $count = $seen{$slug}++;
    $slug .= "-$count" if $count;
    my $name = label($first ? $page : "$page-$slug");
    $first = 0;
    $heading =~ s/`//g;
    # The README is the main page, whose name is Doxygen's.
    print $page eq 'readme' ? "$marks $heading\n" : "$marks $heading {#$name}\n";
  } else {
    print text($line), "\n";
  }
}
