#!/usr/bin/env perl
# header.pl FILE.hpp: the header as Doxygen reads it. The comment that it begins with, up to the first indented line (a list
# or an example, which Doxygen would take apart), describes the file.
use strict;
use warnings;

my $begun = 0;
my $ended = 0;
while (my $line = <>) {
  if (!$ended) {
    if ($line =~ m{^//(?!/)( ?\S.*|\s*)$}) {
      my $text = join '', map { /^`/ ? $_ : s/([<>#])/\\$1/gr } split /(`[^`]*`)/, $1;
      # A term of a formula is no item of a list.
      $text =~ s/^(\s*)([-+] )/$1\\$2/;
      print "///$text\n";
      $begun = 1;
      next;
    }
    # This line says nothing to Doxygen and makes room for the command, so that its warnings name the right lines.
    $ended = 1;
    if ($begun) {
      print "/// \@file\n";
      next;
    }
  }
  print $line;
}
